// What frames hand on to each other beside poses: the human's colours, which all share, and what optimisers have
// learnt.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "body/color_net.h"
#include "optim/checkpoint.h"
#include "optim/stage_settings.h"

namespace hsi4d {

/// The color nets of a run, if it has some, and what their optimisers have accumulated, which persists as they do.
struct ColorState {
  std::vector<ColorNet> nets;  ///< by person; empty: the avatars' own colours
  AdamState moments;           ///< of the groups color_net and avatar_features; without blocks until a stage moves them
  /// What bfgs has learnt of the curvature, by stage, where optimizer.keep_curvature asks for it;
  /// empty: nothing yet.
  std::map<std::string, std::vector<double>, std::less<>> curvature = {};
};

/// A run's start. @param nets  none for a run without
ColorState first_color_state(std::vector<ColorNet> nets);

/// Puts networks and moments into a checkpoint, as "color_net/...", those of the person beside the first one as
/// "color_net_1/..." and so on, and curvatures as "curvature/STAGE". Features are in it once they have moved: else they
/// are those of the start.
void store_color_state(const ColorState& state, Checkpoint& checkpoint);

/// What store_color_state put there, bit for bit.
/// @param first  of the run
/// Throws DataError naming the file and the entry: absent, of another network, or not finite.
ColorState stored_color_state(const Checkpoint& checkpoint, ColorState first);

}  // namespace hsi4d
