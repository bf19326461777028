// One solid from depths that many cameras saw.
//
// At a node x of the grid each view v that sees it says how far it lies before the surface that the pixel shows,
//
//   s_v = c (D_v(π_v(x)) − z_v(x)),   c = |n·r|,
//
// r the pixel's ray for z = 1, n the normal of what the pixel and its neighbours show; c is held to [¼, 1]. s is held
// to the truncation t where it is more; what is more than t behind the surface says nothing, for it is hidden. The
// signed distance is the mean of what the views say [Curless and Levoy 1996], c² their weight, 1 where they say t; −t
// where none says anything: what nobody has seen is solid. A pixel without a surface says t all along its ray. D is
// interpolated between four pixels that show one surface; else it is the smallest of the four, so that a pixel beside
// an edge says nothing of what is behind it.
#pragma once

#include <span>
#include <vector>

#include "core/camera.h"
#include "optim/solid/solid_grid.h"

namespace hsi4d {

/// What a camera sees, or would see.
struct DepthView {
  Camera camera;
  std::vector<float> depths;  ///< [H,W] camera z, metres; 0: nothing that stops half of the light
};

struct FusionSettings {
  double voxel = 0.02;                                                            ///< metres
  double truncation = 3;                                                          ///< voxels
  Vector3<double> low = Vector3<double>::Zero(), high = Vector3<double>::Zero();  ///< corners of the box, metres, world
  bool is_outside_free = false;                                                   ///< of an object; a room is closed
};

/// Blocks that a grid may have at most: with 8³ nodes each, about 2000³ nodes.
inline constexpr Index kMostSolidBlocks = Index{1} << 24U;

/// The solid. The same bits on any number of threads.
/// Throws UserError for a box that has no volume, or of more than kMostSolidBlocks.
SolidGrid fused(std::span<const DepthView> views, const FusionSettings& settings);

}  // namespace hsi4d
