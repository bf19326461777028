#include "pipelines/rig/mesh_library.h"

#include "core/loaded_library.h"

namespace hsi4d {

const MeshLibrary& mesh_library() {
  static const auto function = reinterpret_cast<const MeshLibrary* (*)()>(
      function_of_library("libhsi4d_meshes.so", "hsi4d_mesh_library", "no pictures of meshes can be made"));
  return *function();
}

}  // namespace hsi4d
