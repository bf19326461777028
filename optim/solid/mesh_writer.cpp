// Triangle meshes to files.   [glTF 2.0, Khronos Group: chapters 3.6, 4]
#include <charconv>
#include <limits>

#include "core/check.h"
#include "core/config_value.h"
#include "core/file.h"
#include "core/text.h"
#include "optim/solid/glb.h"
#include "optim/solid/mesh_file.h"

namespace hsi4d {

namespace {

template <class T>
void add_bytes(const T& value, std::string& text) {
  text.append(reinterpret_cast<const char*>(&value), sizeof(value));
}

std::string ply_of(const TriangleMesh& mesh) {
  std::string text = "ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(mesh.vertices.size()) +
                     "\nproperty double x\nproperty double y\nproperty double z\nelement face " +
                     std::to_string(mesh.faces.size()) + "\nproperty list uchar int vertex_indices\nend_header\n";
  for (const Vector3<double>& vertex : mesh.vertices) {
    for (int i = 0; i < 3; ++i) add_bytes(vertex[i], text);
  }
  for (const std::array<std::int32_t, 3>& face : mesh.faces) {
    add_bytes(std::uint8_t{3}, text);
    for (const std::int32_t corner : face) add_bytes(corner, text);
  }
  return text;
}

std::string obj_of(const TriangleMesh& mesh) {
  std::string text;
  const auto add_number = [&text](auto value) {
    std::array<char, 32> digits{};
    text += ' ';
    text.append(digits.data(), std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr);
  };
  for (const Vector3<double>& vertex : mesh.vertices) {
    text += 'v';
    for (int i = 0; i < 3; ++i) add_number(vertex[i]);
    text += '\n';
  }
  for (const std::array<std::int32_t, 3>& face : mesh.faces) {
    text += 'f';
    for (const std::int32_t corner : face) add_number(corner + 1);
    text += '\n';
  }
  return text;
}

ConfigValue object(std::initializer_list<std::pair<const char*, ConfigValue>> members) {
  ConfigValue result = ConfigValue::make_object();
  for (const auto& [key, value] : members) result.add(key, value);
  return result;
}

ConfigValue list_of(std::initializer_list<ConfigValue> items) {
  ConfigValue list = ConfigValue::make_array();
  list.items.assign(items.begin(), items.end());
  return list;
}

/// One mesh, its positions and its corners one after the other in the only buffer.
std::string gltf_of(const TriangleMesh& mesh, const Vector3<float>& low, const Vector3<float>& high) {
  const auto whole = [](std::int64_t value) { return ConfigValue::make_integer(value); };
  const auto text = [](const char* value) { return ConfigValue::make_string(value); };
  const std::int64_t vertices = std::ssize(mesh.vertices), corners = 3 * std::ssize(mesh.faces);
  const auto limits = [](const Vector3<float>& v) {
    return list_of({ConfigValue::make_number(v[0]), ConfigValue::make_number(v[1]), ConfigValue::make_number(v[2])});
  };
  const auto view = [&](std::int64_t offset, std::int64_t bytes, std::int64_t target) {
    return object(
        {{"buffer", whole(0)}, {"byteOffset", whole(offset)}, {"byteLength", whole(bytes)}, {"target", whole(target)}});
  };
  const ConfigValue primitive = object(
      {{"attributes", object({{"POSITION", whole(0)}})}, {"indices", whole(1)}, {"mode", whole(glb::kTriangles)}});
  return to_json_line(object({{"asset", object({{"version", text("2.0")}, {"generator", text("hsi4d")}})},
                              {"scene", whole(0)},
                              {"scenes", list_of({object({{"nodes", list_of({whole(0)})}})})},
                              {"nodes", list_of({object({{"mesh", whole(0)}})})},
                              {"meshes", list_of({object({{"primitives", list_of({primitive})}})})},
                              {"buffers", list_of({object({{"byteLength", whole(12 * vertices + 4 * corners)}})})},
                              {"bufferViews", list_of({view(0, 12 * vertices, glb::kVertexBuffer),
                                                       view(12 * vertices, 4 * corners, glb::kIndexBuffer)})},
                              {"accessors", list_of({object({{"bufferView", whole(0)},
                                                             {"componentType", whole(glb::kFloat)},
                                                             {"count", whole(vertices)},
                                                             {"type", text("VEC3")},
                                                             {"min", limits(low)},
                                                             {"max", limits(high)}}),
                                                     object({{"bufferView", whole(1)},
                                                             {"componentType", whole(glb::kUnsignedInt)},
                                                             {"count", whole(corners)},
                                                             {"type", text("SCALAR")}})})}}));
}

std::string glb_of(const TriangleMesh& mesh) {
  std::string buffer;
  Vector3<float> low = Vector3<float>::Constant(std::numeric_limits<float>::max()), high = -low;
  for (const Vector3<double>& v : mesh.vertices) {
    const Vector3<float> y_up = Vector3<double>(v[0], v[2], -v[1]).cast<float>();
    low = low.cwiseMin(y_up);
    high = high.cwiseMax(y_up);
    for (int i = 0; i < 3; ++i) add_bytes(y_up[i], buffer);
  }
  for (const std::array<std::int32_t, 3>& face : mesh.faces) {
    for (const std::int32_t corner : face) add_bytes(corner, buffer);
  }
  std::string json = gltf_of(mesh, low, high);
  while (json.size() % 4 != 0) json += ' ';
  const std::size_t size = 12 + 8 + json.size() + 8 + buffer.size();
  if (size > std::numeric_limits<std::uint32_t>::max())
    throw UserError("a mesh of this size does not fit into a .glb file");
  std::string file;
  for (const std::uint32_t word : {glb::kMagic, std::uint32_t{2}, static_cast<std::uint32_t>(size),
                                   static_cast<std::uint32_t>(json.size()), glb::kJsonChunk})
    add_bytes(word, file);
  file += json;
  add_bytes(static_cast<std::uint32_t>(buffer.size()), file);
  add_bytes(glb::kBinaryChunk, file);
  return file + buffer;
}

}  // namespace

void write_mesh(const std::string& path, const TriangleMesh& mesh) {
  const std::string ending = mesh_ending(path);
  write_text_file(path, ending == ".obj" ? obj_of(mesh) : ending == ".glb" ? glb_of(mesh) : ply_of(mesh));
}

}  // namespace hsi4d
