// How pictures of a mesh are taken.
#pragma once

#include <array>
#include <optional>

#include "core/types.h"
#include "pipelines/rig/mesh_picture.h"

namespace hsi4d {

/// What is a rig of 0 pictures: those of the paper.
inline constexpr Index kPicturesOfObject = 70, kPicturesOfScene = 300;

/// Cameras about a mesh, or in it, and their pictures.
struct RigSettings {
  Index count = 0;  ///< pictures; 0: kPicturesOfObject, kPicturesOfScene
  int size = 512;   ///< pixels, width and height
  MeshLight light;
  // Of a scene, whose places are sought.
  double nearest = 0.25;                          ///< of what a camera sees and what is around it, metres
  double least_seen = 0.3;                        ///< share of a picture that shows something
  double most_backs = 0.05;                       ///< share of a picture that shows backs of faces
  std::optional<std::array<double, 6>> box = {};  ///< x, y, z of two corners; none: the mesh's bounds
};

}  // namespace hsi4d
