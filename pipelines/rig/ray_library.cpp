#include "pipelines/rig/ray_library.h"

#include "core/loaded_library.h"

namespace hsi4d {

const RayLibrary& ray_library() {
  static const auto function = reinterpret_cast<const RayLibrary* (*)()>(
      function_of_library("libhsi4d_rays.so", "hsi4d_ray_library", "no pictures of meshes can be made"));
  return *function();
}

}  // namespace hsi4d
