// A solid, and its closed surface, from Gaussians: `hsi4d mesh`.
//
// Cameras look at the Gaussians, and what they see as depth becomes one solid (optim/solid/depth_fusion.h). Of a room
// cameras in it are given; more are placed where those have seen free space, and see all around. What nobody sees is
// solid, so that the room is a hollow. An object is looked at from all around, and outside of it is free.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "core/camera.h"
#include "core/observer.h"
#include "optim/solid/depth_fusion.h"
#include "splat/gaussians.h"
#include "splat/render_settings.h"

namespace hsi4d {

struct SurfaceSettings {
  bool is_object = false;
  std::vector<Camera> cameras;               ///< given; of a room at least one
  std::optional<double> voxel;               ///< metres; without: by the box's longest side
  std::optional<std::array<double, 6>> box;  ///< low and high corner, metres; without: what the cameras see
  Index more_views = 144;                    ///< that are placed beside the given ones
  int size_px = 512;                         ///< longest side of all views; given ones are reduced to it
  Index smallest = 512;                      ///< nodes of a piece that is kept
  RenderSettings render;
};

/// Voxels along the longest side, unless the voxel is given: of a room of 6 m, 15 mm; of a can of 40 cm, 2 mm.
inline constexpr double kVoxelsAlongRoom = 400, kVoxelsAlongObject = 200;

/// What came of it.
struct ScannedSolid {
  SolidGrid grid;
  CleanUp cleaned;
  std::vector<DepthView> views;  ///< the given ones first
};

/// Renders depths, fuses them, places more cameras, renders and fuses again, and cleans up.
/// Throws UserError where cameras see nothing, or as fused; Interrupted.
ScannedSolid scanned_solid(const Gaussians& gaussians, const SurfaceSettings& settings, const Observer& observer = {});

/// Places in free space for `count` eyes, each as far as it can be from the cameras there are and from each other, and
/// at least `clearance` metres from what is solid. Fewer where there are no more.
std::vector<Vector3<double>> more_eyes(const SolidGrid& grid, const std::vector<Camera>& cameras, Index count,
                                       double clearance);

}  // namespace hsi4d
