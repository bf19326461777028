// The scenes of synthetic clips, as Gaussians. Everything is a function of the settings and the seed.
#pragma once

#include <cstdint>

#include "optim/solid/mesh_file.h"
#include "pipelines/config/synthetic_places.h"
#include "pipelines/config/synthetic_settings.h"
#include "splat/gaussians.h"

namespace hsi4d {

/// What a scene is arranged around, so that the action fits into it. World coordinates, metres.
struct ScenePlan {
  Vector3<double> support{-0.25, 0.35, 0.75};  ///< what the object stands on: middle of its upper side
  double support_turn = 0;                     ///< about z, radians
  bool has_table = true;                       ///< the support is a table
  bool has_screen = false;                     ///< a board on the table, before the object as the camera sees it
  bool has_stand = false;                      ///< it is a stand on the floor
  bool has_posts = false;                      ///< it is the foot of the hinge of a gate between two posts
  Vector2<double> middle{0, 0.6};              ///< where the person acts
  double seen_from_y = 0.2;                    ///< the cameras see the floor from here on
  const ScenePlace* place = nullptr;           ///< of the scene, which the person acts at; none: in the middle
};

/// The scene with what the plan asks for. The light is baked into the colours; some surfaces shine a little (spherical
/// harmonics of degree 1). All are around (0, 0), ground at z = 0, open towards −y.
///
/// @param most  Gaussians, at least kFewestSceneGaussians; as near to it as whole cells of the surfaces allow
Gaussians synthetic_scene(SyntheticSceneKind kind, Index most, const ScenePlan& plan, std::uint64_t seed);

/// The scene of the settings: of scene_file with what the plan asks for put into it, where there is one.
/// Throws as read_splats; DataError when the file holds no Gaussians.
Gaussians synthetic_scene(const SyntheticSettings& settings, const ScenePlan& plan);

/// What is certainly solid in the scene of the settings: the ground, and the boxes that furniture is made of. What is
/// round or soft (plants, curtains, tubes), and walls, are not in it. Of a scene_file nothing is known: no faces.
TriangleMesh synthetic_solids(const SyntheticSettings& settings, const ScenePlan& plan);

/// One line of what a scene is.
const char* scene_summary(SyntheticSceneKind kind);

}  // namespace hsi4d
