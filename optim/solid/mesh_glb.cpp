// The triangles of a binary glTF file.
#include <limits>

#include "core/check.h"
#include "optim/solid/glb_file.h"
#include "optim/solid/mesh_file.h"

namespace hsi4d {

TriangleMesh detail::parse_glb_mesh(std::span<const std::uint8_t> file, const std::string& name) {
  const GlbFile glb(file, name);
  TriangleMesh mesh;
  glb.each_primitive([&](const GlbPrimitive& primitive) {
    const std::size_t first = mesh.vertices.size();
    mesh.vertices.insert(mesh.vertices.end(), primitive.vertices.begin(), primitive.vertices.end());
    if (mesh.vertices.size() > static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max()))
      glb.fail("there are more vertices than can be numbered");
    for (std::array<std::int32_t, 3> face : primitive.faces) {
      for (std::int32_t& corner : face) corner += static_cast<std::int32_t>(first);
      mesh.faces.push_back(face);
    }
  });
  return mesh;
}

}  // namespace hsi4d
