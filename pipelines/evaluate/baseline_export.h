// What other methods start from: trajectories and initial states of a motion, in the forms that TRUMANS, LINGO and
// CHOIS take (docs/formats.md).
#pragma once

#include <array>
#include <string>
#include <vector>

#include "pipelines/evaluate/evaluation.h"
#include "pipelines/metrics/solid.h"

namespace hsi4d {

/// A box of voxels in a world of y up, as TRUMANS and LINGO have them.
struct VoxelBox {
  Vector3<double> low, high;   ///< metres, y up
  std::array<Index, 3> cells;  ///< X, Y, Z
};

/// Of TRUMANS (and of LINGO's training), and of LINGO when it is run.
inline const VoxelBox kTrumansBox{{-3, 0, -4}, {3, 2, 4}, {300, 100, 400}};
inline const VoxelBox kLingoBox{{-4, 0, -6}, {4, 2, 6}, {400, 100, 600}};

/// Which voxels' centres are in the solid, [X,Y,Z], z fastest. Blocks of voxels that are nearer to their middle than
/// that is to any surface are not looked at one by one.
/// @param distance  no farther from 0 than any surface is away
std::vector<std::uint8_t> voxels_in(const SignedDistance& distance, const VoxelBox& box);

/// Writes what other methods need to make the motion of `input` in its scene: the motion at 30 frames a second, its
/// objects, the initial state, and for each method its own files. What is solid is as evaluate() takes it; without it
/// no grids are written.
///
/// @return  a line for people: what was written where
/// Throws as evaluate(); UserError where a file cannot be written.
std::string export_for_baselines(const EvaluationSettings& settings, const std::string& input,
                                 const std::string& folder);

}  // namespace hsi4d
