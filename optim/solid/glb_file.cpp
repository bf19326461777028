// [glTF 2.0, Khronos Group: chapters 3.6, 3.7, 4]
#include "optim/solid/glb_file.h"

#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>

#include "core/check.h"
#include "core/config_parse.h"
#include "core/quaternion.h"
#include "optim/solid/glb.h"

namespace hsi4d {

namespace {

using Kind = ConfigValue::Kind;

constexpr int kDeepestNode = 64;  // nodes in nodes
constexpr std::size_t kMostPieces = 1000000;

std::size_t columns_of(std::string_view type) {
  return type == "SCALAR" ? 1 : static_cast<std::size_t>(type.back() - '0');  // "VEC3"
}

std::size_t index_at(int component, const std::uint8_t* at) {
  if (component == glb::kUnsignedByte) return *at;
  if (component == glb::kUnsignedShort) {
    std::uint16_t index = 0;
    std::memcpy(&index, at, sizeof(index));
    return index;
  }
  std::uint32_t index = 0;
  std::memcpy(&index, at, sizeof(index));
  return index;
}

/// As a share of the type's largest number, or as it is.
float share_at(int component, const std::uint8_t* at) {
  float x = 0;
  if (component == glb::kFloat) {
    std::memcpy(&x, at, sizeof(x));
    return x;
  }
  return static_cast<float>(index_at(component, at)) / (component == glb::kUnsignedByte ? 255.0F : 65535.0F);
}

}  // namespace

GlbFile::GlbFile(std::span<const std::uint8_t> file, const std::string& name) : file_(file), name_(name) {
  read_chunks();
}

void GlbFile::each_primitive(const std::function<void(const GlbPrimitive&)>& take) const {
  const ConfigValue* const scenes = find_member(json_, "scenes");
  if (scenes == nullptr || scenes->items.empty()) fail("there is no scene");
  const ConfigValue& scene = item(*scenes, "scenes", whole(json_, "scene", 0));
  const ConfigValue* const nodes = find_member(scene, "nodes");
  Transform z_up;
  z_up << 1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0;
  Counts counts;
  if (nodes == nullptr) return;
  for (const ConfigValue& node : nodes->items) add_node(number_of(node, "a node of the scene"), z_up, 0, counts, take);
}

void GlbFile::fail(const std::string& problem) const { throw DataError(name_ + ": " + problem); }

std::uint32_t GlbFile::word_at(std::size_t at) const {
  if (at + 4 > file_.size()) fail("the file ends after " + std::to_string(file_.size()) + " bytes");
  std::uint32_t word = 0;
  std::memcpy(&word, file_.data() + at, 4);
  return word;
}

void GlbFile::read_chunks() {
  if (word_at(0) != glb::kMagic) fail("this is no .glb file: it does not begin with \"glTF\"");
  if (word_at(4) != 2) fail("glTF version " + std::to_string(word_at(4)) + " is not known; version 2 is");
  for (std::size_t at = 12; at < file_.size();) {
    const std::size_t length = word_at(at);
    const std::uint32_t type = word_at(at + 4);
    at += 8;
    if (length > file_.size() - at) fail("a chunk of " + std::to_string(length) + " bytes goes beyond the file's end");
    const auto chunk = file_.subspan(at, length);
    if (type == glb::kJsonChunk && json_.kind == Kind::kNull) parse_json(chunk);
    if (type == glb::kBinaryChunk && binary_.empty()) binary_ = chunk;
    at += length;
  }
  if (json_.kind != Kind::kObject) fail("there is no JSON chunk");
}

void GlbFile::parse_json(std::span<const std::uint8_t> chunk) {
  auto source = std::make_shared<ConfigSource>();
  source->name = name_;
  const std::string text(reinterpret_cast<const char*>(chunk.data()), chunk.size());
  if (!parse_json_value(text, source, json_) || json_.kind != Kind::kObject) fail("its JSON cannot be read");
}

double GlbFile::number(const ConfigValue& value, const char* what) const {
  if (value.kind != Kind::kNumber) fail(std::string(what) + " is " + kind_name(value) + ", not a number");
  double x = 0;
  const char* const end = value.text.data() + value.text.size();
  const auto read = std::from_chars(value.text.data(), end, x);
  if (read.ec != std::errc() || read.ptr != end || !std::isfinite(x)) fail(std::string(what) + " is " + value.text);
  return x;
}
std::size_t GlbFile::number_of(const ConfigValue& value, const char* what) const {
  const double x = number(value, what);
  if (!(x >= 0 && x <= 4294967295.0) || x != std::floor(x)) fail(std::string(what) + " is " + value.text);
  return static_cast<std::size_t>(x);
}
std::size_t GlbFile::whole(const ConfigValue& object, const char* key, std::optional<std::size_t> otherwise) const {
  const ConfigValue* const member = find_member(object, key);
  if (member != nullptr) return number_of(*member, key);
  if (!otherwise) fail(std::string("there is no \"") + key + "\" where one is needed");
  return *otherwise;
}
const ConfigValue& GlbFile::item(const ConfigValue& array, const char* what, std::size_t i) const {
  if (i >= array.items.size())
    fail(std::string("there is no entry ") + std::to_string(i) + " among the " + std::to_string(array.items.size()) +
         " of \"" + what + "\"");
  return array.items[i];
}
const ConfigValue& GlbFile::entry(const char* what, std::size_t i) const {
  const ConfigValue* const array = find_member(json_, what);
  if (array == nullptr) fail(std::string("there is no \"") + what + "\"");
  return item(*array, what, i);
}

std::vector<double> GlbFile::numbers(const ConfigValue& object, const char* key, std::vector<double> otherwise) const {
  const ConfigValue* const member = find_member(object, key);
  if (member == nullptr) return otherwise;
  if (member->items.size() != otherwise.size())
    fail(std::string("\"") + key + "\" is not " + std::to_string(otherwise.size()) + " numbers");
  for (std::size_t i = 0; i < otherwise.size(); ++i) otherwise[i] = number(member->items[i], key);
  return otherwise;
}

double GlbFile::numbers(const ConfigValue& object, const char* key, double otherwise) const {
  const ConfigValue* const member = find_member(object, key);
  return member == nullptr ? otherwise : number(*member, key);
}

GlbFile::Transform GlbFile::transform_of(const ConfigValue& node) const {
  Transform t;
  if (find_member(node, "matrix") != nullptr) {
    const std::vector<double> m = numbers(node, "matrix", std::vector<double>(16));
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 4; ++c) t(r, c) = m[static_cast<std::size_t>(4 * c + r)];
    }
    return t;
  }
  const std::vector<double> move = numbers(node, "translation", {0, 0, 0}),
                            turn = numbers(node, "rotation", {0, 0, 0, 1}), size = numbers(node, "scale", {1, 1, 1});
  const auto q = direction_of(Vector4<double>(turn[3], turn[0], turn[1], turn[2]));
  if (!q.usable) fail("\"rotation\" is zero");
  t.leftCols<3>() = detail::unit_quaternion_to_matrix(q.unit) * Vector3<double>(size[0], size[1], size[2]).asDiagonal();
  t.col(3) = Eigen::Vector3d(move[0], move[1], move[2]);
  return t;
}

void GlbFile::add_node(std::size_t index, const Transform& world_from_parent, int depth, Counts& counts,
                       const Take& take) const {
  if (depth > kDeepestNode) fail("nodes lie more than " + std::to_string(kDeepestNode) + " deep in each other");
  if (++counts.nodes > kMostPieces) fail("its nodes hold each other more than a million times");
  const ConfigValue& node = entry("nodes", index);
  const Transform local = transform_of(node);
  Transform world;
  world.leftCols<3>() = world_from_parent.leftCols<3>() * local.leftCols<3>();
  world.col(3) = world_from_parent.leftCols<3>() * local.col(3) + world_from_parent.col(3);
  if (find_member(node, "mesh") != nullptr) add_mesh(entry("meshes", whole(node, "mesh")), world, counts, take);
  const ConfigValue* const children = find_member(node, "children");
  if (children == nullptr) return;
  for (const ConfigValue& child : children->items)
    add_node(number_of(child, "a child of a node"), world, depth + 1, counts, take);
}

void GlbFile::add_mesh(const ConfigValue& mesh, const Transform& world, Counts& counts, const Take& take) const {
  const ConfigValue* const primitives = find_member(mesh, "primitives");
  if (primitives == nullptr) return;
  for (const ConfigValue& primitive : primitives->items) {
    if (whole(primitive, "mode", glb::kTriangles) != glb::kTriangles) continue;  // points, lines, strips
    if (++counts.primitives > kMostPieces) fail("there are more than a million pieces of meshes");
    const ConfigValue* const attributes = find_member(primitive, "attributes");
    if (attributes != nullptr && find_member(*attributes, "POSITION") != nullptr)
      take(primitive_of(primitive, *attributes, world));
  }
}

void GlbFile::read_accessor(std::size_t index, const char* type,
                            const std::function<void(int component, const std::uint8_t* at)>& take) const {
  const ConfigValue& accessor = entry("accessors", index);
  const ConfigValue* const its_type = find_member(accessor, "type");
  if (its_type == nullptr || its_type->text != type)
    fail("accessor " + std::to_string(index) + " is not of type " + type);
  if (find_member(accessor, "sparse") != nullptr) fail("sparse accessors are not read");
  const auto component = static_cast<int>(whole(accessor, "componentType"));
  const std::size_t columns = columns_of(type);
  const std::size_t bytes = component == glb::kUnsignedByte ? 1 : component == glb::kUnsignedShort ? 2 : 4;
  if (component != glb::kFloat && component != glb::kUnsignedByte && component != glb::kUnsignedShort &&
      component != glb::kUnsignedInt)
    fail("accessor " + std::to_string(index) + " has the component type " + std::to_string(component));
  if (columns == 1 && component == glb::kFloat) fail("corners of triangles are floats");
  const ConfigValue& view = entry("bufferViews", whole(accessor, "bufferView"));
  if (whole(view, "buffer") != 0) fail("numbers are read of the file's own buffer alone, which is buffer 0");
  const std::size_t element = columns * bytes, count = whole(accessor, "count");
  const std::size_t stride = whole(view, "byteStride", element);
  const std::size_t begin = whole(view, "byteOffset", 0) + whole(accessor, "byteOffset", 0);
  if (stride < element) fail("accessor " + std::to_string(index) + " has a stride of " + std::to_string(stride));
  if (count == 0) return;
  if (begin > binary_.size() || binary_.size() - begin < element ||
      (binary_.size() - begin - element) / stride < count - 1)
    fail("accessor " + std::to_string(index) + " goes beyond the file's " + std::to_string(binary_.size()) +
         " bytes of numbers");
  for (std::size_t i = 0; i < count; ++i) take(component, binary_.data() + begin + i * stride);
}

GlbPrimitive GlbFile::primitive_of(const ConfigValue& json, const ConfigValue& attributes,
                                   const Transform& world) const {
  GlbPrimitive result{json, attributes, {}, {}, world.leftCols<3>()};
  read_accessor(whole(attributes, "POSITION"), "VEC3", [&](int component, const std::uint8_t* at) {
    if (component != glb::kFloat) fail("places of vertices are no floats");
    std::array<float, 3> x{};
    std::memcpy(x.data(), at, sizeof(x));
    const Eigen::Vector3d local(static_cast<double>(x[0]), static_cast<double>(x[1]), static_cast<double>(x[2]));
    result.vertices.emplace_back(world.leftCols<3>() * local + world.col(3));
  });
  const std::vector<std::size_t> corners = corners_of(json, result.vertices.size());
  const Matrix3<double>& axes = result.axes;
  const bool mirrored =
      dot(Vector3<double>(axes.col(0)), cross(Vector3<double>(axes.col(1)), Vector3<double>(axes.col(2)))) < 0;
  for (std::size_t i = 0; i + 2 < corners.size(); i += 3) {
    std::array<std::int32_t, 3> face{};
    for (std::size_t k = 0; k < 3; ++k) face[k] = static_cast<std::int32_t>(corners[i + k]);
    if (mirrored) std::swap(face[1], face[2]);
    result.faces.push_back(face);
  }
  return result;
}

std::vector<std::size_t> GlbFile::corners_of(const ConfigValue& primitive, std::size_t vertices) const {
  if (vertices > static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max()))
    fail("there are more vertices than can be numbered");
  std::vector<std::size_t> corners;
  if (find_member(primitive, "indices") == nullptr) {
    for (std::size_t i = 0; i < vertices; ++i) corners.push_back(i);
    return corners;
  }
  read_accessor(whole(primitive, "indices"), "SCALAR", [&](int component, const std::uint8_t* at) {
    corners.push_back(index_at(component, at));
    if (corners.back() >= vertices)
      fail("a triangle has the corner " + std::to_string(corners.back()) + " of " + std::to_string(vertices) +
           " vertices");
  });
  return corners;
}

std::span<const std::uint8_t> GlbFile::view_bytes(std::size_t view) const {
  const ConfigValue& json = entry("bufferViews", view);
  if (whole(json, "buffer") != 0) fail("bytes are read of the file's own buffer alone, which is buffer 0");
  const std::size_t begin = whole(json, "byteOffset", 0), length = whole(json, "byteLength");
  if (begin > binary_.size() || length > binary_.size() - begin)
    fail("buffer view " + std::to_string(view) + " goes beyond the file's " + std::to_string(binary_.size()) +
         " bytes of numbers");
  return binary_.subspan(begin, length);
}

std::vector<float> GlbFile::rows(std::size_t accessor, const char* type, std::size_t columns) const {
  std::vector<float> all;
  read_accessor(accessor, type, [&](int component, const std::uint8_t* at) {
    if (component == glb::kUnsignedInt) fail("accessor " + std::to_string(accessor) + " has whole numbers of 32 bits");
    const std::size_t bytes = component == glb::kFloat ? 4 : component == glb::kUnsignedByte ? 1 : 2;
    for (std::size_t i = 0; i < columns; ++i) all.push_back(share_at(component, at + i * bytes));
  });
  return all;
}

}  // namespace hsi4d
