// Meshes in OBJ, PLY and GLB. What is taken has triangles of vertices that are there, and a distance.
#include <cstring>
#include <string>
#include <string_view>

#include "optim/solid/mesh_distance.h"
#include "tests/fuzz/fuzz.h"

namespace hsi4d::fuzz::mesh_fuzz {
namespace {

Bytes bytes_of(std::string_view text) { return Bytes(text.begin(), text.end()); }

constexpr std::string_view kObj = R"(# a tetrahedron
o thing
v 0 0 0
v 1 0 0 0.5 0.5 0.5
v 0 +1e0 0
v 0 0 1
vn 0 0 1
f 1/1/1 3//1 2
f 1 2 4
f 2 3 -1
f -2 -4 -1
)";

constexpr std::string_view kPly = R"(ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
property uchar red
element face 2
property uchar flag
property list uchar int vertex_indices
end_header
0 0 0 7
1 0 0 7
1 1 0 7
0 1 0 7
1 4 0 1 2 3
0 3 0 2 1
)";

constexpr std::string_view kJson =
    R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"children":[1],"scale":[1,2,3]},)"
    R"({"mesh":0,"rotation":[0,0,0,1],"translation":[1,0,0]}],"meshes":[{"primitives":[{"attributes":{"POSITION":0},)"
    R"("indices":1}]}],"accessors":[{"bufferView":0,"componentType":5126,"type":"VEC3","count":3},)"
    R"({"bufferView":1,"componentType":5123,"type":"SCALAR","count":3}],"bufferViews":[{"buffer":0,"byteLength":36},)"
    R"({"buffer":0,"byteOffset":36,"byteLength":6}],"buffers":[{"byteLength":44}]} )";

Bytes glb() {
  std::string numbers(44, '\0');
  const float corners[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  const std::uint16_t indices[3] = {0, 1, 2};
  std::memcpy(numbers.data(), corners, sizeof(corners));
  std::memcpy(numbers.data() + sizeof(corners), indices, sizeof(indices));
  const auto word = [](std::size_t x) {
    const auto number = static_cast<std::uint32_t>(x);
    return std::string(reinterpret_cast<const char*>(&number), 4);
  };
  std::string json(kJson);
  while (json.size() % 4 != 0) json += ' ';
  const std::string chunks =
      word(json.size()) + "JSON" + json + word(numbers.size()) + std::string("BIN\0", 4) + numbers;
  return bytes_of("glTF" + word(2) + word(12 + chunks.size()) + chunks);
}

void check_mesh(std::span<const uint8_t> file, const char* name) {
  const TriangleMesh mesh = parse_mesh(file, name);
  HSI4D_CHECK(!mesh.faces.empty(), "a mesh without faces was taken");
  for (const auto& face : mesh.faces) {
    for (const std::int32_t corner : face)
      HSI4D_CHECK(corner >= 0 && static_cast<std::size_t>(corner) < mesh.vertices.size(), "a corner is no vertex");
  }
  if (mesh.faces.size() < 1000) MeshDistance(mesh, 0.1).at({0.1, 0.2, 0.3});
}

}  // namespace

std::vector<Bytes> corpus() { return {bytes_of(kObj), bytes_of(kPly), glb()}; }

bool accepts(std::span<const uint8_t> file) {
  bool is_accepted = false;
  for (const char* name : {"fuzz.obj", "fuzz.ply", "fuzz.glb"})
    is_accepted = is_read([&] { check_mesh(file, name); }) || is_accepted;
  return is_accepted;
}

const Target target("mesh", corpus, accepts);

}  // namespace hsi4d::fuzz::mesh_fuzz
