#include "pipelines/rig/loaded_mesh.h"

#include <algorithm>

namespace hsi4d {

std::int32_t add_vertex(LoadedMesh& mesh, const Vector3<double>& place) {
  mesh.places.push_back(place);
  mesh.normals.push_back({0, 0, 0});
  mesh.uvs.push_back({0, 0});
  mesh.colors.push_back({1, 1, 1, 1});
  return static_cast<std::int32_t>(mesh.places.size() - 1);
}

void add_face(LoadedMesh& mesh, const std::array<std::int32_t, 3>& face, std::size_t material) {
  mesh.faces.push_back(face);
  mesh.materials_of_faces.push_back(static_cast<std::int32_t>(material));
}

int add_texture(LoadedMesh& mesh, const std::string& file) {
  const auto found = std::find_if(mesh.textures.begin(), mesh.textures.end(),
                                  [&](const MeshTexture& texture) { return texture.file == file; });
  if (found == mesh.textures.end()) {
    mesh.textures.push_back({file, {}, false});
    return static_cast<int>(mesh.textures.size() - 1);
  }
  return static_cast<int>(found - mesh.textures.begin());
}

}  // namespace hsi4d
