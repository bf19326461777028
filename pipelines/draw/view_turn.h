// How far a stage turns what moves against the camera: what approximations take for small when it begins.
#pragma once

#include "pipelines/input/clip.h"
#include "pipelines/input/state.h"

namespace hsi4d {

/// Held colours (approx.hold_colors) are told of as out of date from this far on, degrees: a twelfth of the period of
/// harmonics of degree 3.
inline constexpr double kHeldColorsDeg = 10;

/// Degrees between the directions in which the camera is seen before and after, in the axes of each object and of each
/// joint of the human: the largest. A part without a distance to the camera counts as not turned.
double view_turn_deg(const Clip& clip, const SceneState& before, const SceneState& after);

}  // namespace hsi4d
