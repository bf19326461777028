// What is solid, from whichever source there is: a mesh, a grid of voxels, or what Gaussians show.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "core/linear.h"
#include "splat/gaussians.h"

namespace hsi4d {

/// Metres: positive in free space, negative in the solid, NaN where it is not known. By several threads at once.
using SignedDistance = std::function<double(const Vector3<double>&)>;

/// What is solid, and how it is known.
struct Solid {
  SignedDistance distance;  ///< empty: nothing is known
  std::string source;       ///< for people: "the mesh surface.ply"
};

/// Of a mesh (.obj, .ply, .glb), metres, world. Errors as read_mesh_distance.
Solid mesh_solid(const std::string& path);

/// Of a grid of voxels (optim/solid/occupancy_grid.h). Errors as read_occupancy.
Solid occupancy_solid(const std::string& path);

/// Of what a scene's Gaussians show (optim/solid/gaussian_surface.h).
/// @param free_places  metres, world, known to lie in free space: cameras, joints of a body
/// @param name         of the file, for `source`
/// @return  without a distance where no Gaussian is opaque, flat and seen from there
Solid gaussian_solid(const Gaussians& scene, const std::vector<Vector3<double>>& free_places, const std::string& name);

/// Of what an object's Gaussians show from all around, in the object's own frame: it is solid as deep as
/// kMeasuredThickness behind its surface.
/// @param object  relative to the centroid of its means
/// @return  without a distance where no Gaussian is opaque and flat
Solid object_solid(const Gaussians& object, const std::string& name);

/// The mean of a mesh's vertices, each place once: what poses of an object act about of which no Gaussians are known.
/// Errors as read_mesh.
Vector3<double> mesh_centroid(const std::string& path);

/// Of an object's mesh, in the frame of its Gaussians' file; `centroid` of their means is where the object's own frame
/// has its origin.
Solid object_mesh_solid(const std::string& path, const Vector3<double>& centroid);

}  // namespace hsi4d
