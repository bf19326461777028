// Where the cameras are that a mesh is photographed from [Li et al. 2024, B.1 and B.2].
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/camera.h"
#include "pipelines/rig/cast_mesh.h"
#include "pipelines/rig/settings.h"

namespace hsi4d {

/// Cameras, and what was left out.
struct Rig {
  std::vector<Camera> cameras;
  Index tried = 0;    ///< places
  Index no_room = 0;  ///< without a floor, or in something, or with something near
  Index near = 0;     ///< views with something near before the camera
  Index backs = 0;    ///< views of backs of faces
  Index little = 0;   ///< views that show little
  Index spare = 0;    ///< good ones that show what others show
  double seen = 0;    ///< share of what all good views show that those taken show
};

/// Around a mesh that stands free: evenly on a sphere, from below too.
Rig rig_around(const TexturedMesh& mesh, const RigSettings& settings);

/// Inside a mesh. Places are anywhere over a floor, at heights of hands and eyes. Half of the views go where it is
/// widest, half to any side, up and down too. Views are left out by settings.nearest, least_seen and most_backs; of the
/// others, those are taken that show most of what few show. A function of its arguments, for any number of threads.
///
/// @param name  what messages call the mesh
/// Throws UserError where no view is good, with the numbers of Rig.
Rig rig_inside(const CastMesh& mesh, const RigSettings& settings, std::uint64_t seed, const std::string& name);

/// "of 812 places 300 views; left out: …", for the log.
std::string rig_text(const Rig& rig);

}  // namespace hsi4d
