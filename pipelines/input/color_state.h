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

/// The color net of a run, if it has one, and what its optimisers have accumulated, which persists as it does.
struct ColorState {
  std::optional<ColorNet> net;
  AdamState moments;  ///< of the groups color_net and avatar_features; without blocks until a stage moves them
  /// What bfgs has learnt of the curvature, by stage, where optimizer.keep_curvature asks for it;
  /// empty: nothing yet.
  std::map<std::string, std::vector<double>, std::less<>> curvature = {};
};

/// A run's start. @param net  nothing for a run without
ColorState first_color_state(std::optional<ColorNet> net);

/// Puts network and moments into a checkpoint, as "color_net/...", and curvatures as "curvature/STAGE". Features are in
/// it once they have moved: else they are those of the start.
void store_color_state(const ColorState& state, Checkpoint& checkpoint);

/// What store_color_state put there, bit for bit.
/// @param first  of the run
/// Throws DataError naming the file and the entry: absent, of another network, or not finite.
ColorState stored_color_state(const Checkpoint& checkpoint, ColorState first);

}  // namespace hsi4d
