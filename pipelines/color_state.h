// The human's colours in the course of a run: all frames share them, and each goes on from where the last one left off.
#pragma once

#include <optional>

#include "body/color_net.h"
#include "optim/checkpoint.h"
#include "optim/stage_settings.h"

namespace hsi4d {

/// The color net of a run, if it has one, and what its optimisers have accumulated, which persists as it does.
struct ColorState {
  std::optional<ColorNet> net;
  AdamState moments;  ///< of the groups color_net and avatar_features; without blocks until a stage moves them
};

/// A run's start. @param net  nothing for a run without
ColorState first_color_state(std::optional<ColorNet> net);

/// Puts network and moments into a checkpoint, as "color_net/...". Features are in it once they have moved: else they
/// are those of the start.
void store_color_state(const ColorState& state, Checkpoint& checkpoint);

/// What store_color_state put there, bit for bit.
/// @param first  of the run
/// Throws DataError naming the file and the entry: absent, of another network, or not finite.
ColorState stored_color_state(const Checkpoint& checkpoint, ColorState first);

}  // namespace hsi4d
