// The triangles of a binary glTF file.   [glTF 2.0, Khronos Group: chapters 3.6, 3.7, 4]
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <optional>

#include "core/check.h"
#include "core/config_parse.h"
#include "core/quaternion.h"
#include "optim/solid/glb.h"
#include "optim/solid/mesh_file.h"

namespace hsi4d {

namespace {

using Kind = ConfigValue::Kind;
using Transform = Eigen::Matrix<double, 3, 4>;

constexpr int kDeepestNode = 64;  // nodes in nodes
constexpr std::size_t kMostPieces = 1000000;

class GlbParser {
 public:
  GlbParser(std::span<const std::uint8_t> file, const std::string& name) : file_(file), name_(name) {}

  TriangleMesh parse() {
    read_chunks();
    const ConfigValue* const scenes = find_member(json_, "scenes");
    if (scenes == nullptr || scenes->items.empty()) fail("there is no scene");
    const ConfigValue& scene = item(*scenes, "scenes", whole(json_, "scene", 0));
    const ConfigValue* const nodes = find_member(scene, "nodes");
    Transform z_up;
    z_up << 1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0;
    if (nodes != nullptr) {
      for (const ConfigValue& node : nodes->items) add_node(number_of(node, "a node of the scene"), z_up, 0);
    }
    return std::move(mesh_);
  }

 private:
  [[noreturn]] void fail(const std::string& problem) const { throw DataError(name_ + ": " + problem); }

  std::uint32_t word_at(std::size_t at) const {
    if (at + 4 > file_.size()) fail("the file ends after " + std::to_string(file_.size()) + " bytes");
    std::uint32_t word = 0;
    std::memcpy(&word, file_.data() + at, 4);
    return word;
  }

  void read_chunks() {
    if (word_at(0) != glb::kMagic) fail("this is no .glb file: it does not begin with \"glTF\"");
    if (word_at(4) != 2) fail("glTF version " + std::to_string(word_at(4)) + " is not known; version 2 is");
    for (std::size_t at = 12; at < file_.size();) {
      const std::size_t length = word_at(at);
      const std::uint32_t type = word_at(at + 4);
      at += 8;
      if (length > file_.size() - at)
        fail("a chunk of " + std::to_string(length) + " bytes goes beyond the file's end");
      const auto chunk = file_.subspan(at, length);
      if (type == glb::kJsonChunk && json_.kind == Kind::kNull) parse_json(chunk);
      if (type == glb::kBinaryChunk && binary_.empty()) binary_ = chunk;
      at += length;
    }
    if (json_.kind != Kind::kObject) fail("there is no JSON chunk");
  }

  void parse_json(std::span<const std::uint8_t> chunk) {
    auto source = std::make_shared<ConfigSource>();
    source->name = name_;
    const std::string text(reinterpret_cast<const char*>(chunk.data()), chunk.size());
    if (!parse_json_value(text, source, json_) || json_.kind != Kind::kObject) fail("its JSON cannot be read");
  }

  double number(const ConfigValue& value, const char* what) const {
    if (value.kind != Kind::kNumber) fail(std::string(what) + " is " + kind_name(value) + ", not a number");
    double x = 0;
    const char* const end = value.text.data() + value.text.size();
    const auto read = std::from_chars(value.text.data(), end, x);
    if (read.ec != std::errc() || read.ptr != end || !std::isfinite(x)) fail(std::string(what) + " is " + value.text);
    return x;
  }
  std::size_t number_of(const ConfigValue& value, const char* what) const {
    const double x = number(value, what);
    if (!(x >= 0 && x <= 4294967295.0) || x != std::floor(x)) fail(std::string(what) + " is " + value.text);
    return static_cast<std::size_t>(x);
  }
  std::size_t whole(const ConfigValue& object, const char* key, std::optional<std::size_t> otherwise = {}) const {
    const ConfigValue* const member = find_member(object, key);
    if (member != nullptr) return number_of(*member, key);
    if (!otherwise) fail(std::string("there is no \"") + key + "\" where one is needed");
    return *otherwise;
  }
  const ConfigValue& item(const ConfigValue& array, const char* what, std::size_t i) const {
    if (i >= array.items.size())
      fail(std::string("there is no entry ") + std::to_string(i) + " among the " + std::to_string(array.items.size()) +
           " of \"" + what + "\"");
    return array.items[i];
  }
  const ConfigValue& entry(const char* what, std::size_t i) const {
    const ConfigValue* const array = find_member(json_, what);
    if (array == nullptr) fail(std::string("there is no \"") + what + "\"");
    return item(*array, what, i);
  }

  std::vector<double> numbers(const ConfigValue& object, const char* key, std::vector<double> otherwise) const {
    const ConfigValue* const member = find_member(object, key);
    if (member == nullptr) return otherwise;
    if (member->items.size() != otherwise.size())
      fail(std::string("\"") + key + "\" is not " + std::to_string(otherwise.size()) + " numbers");
    for (std::size_t i = 0; i < otherwise.size(); ++i) otherwise[i] = number(member->items[i], key);
    return otherwise;
  }

  Transform transform_of(const ConfigValue& node) const {
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
    t.leftCols<3>() =
        detail::unit_quaternion_to_matrix(q.unit) * Vector3<double>(size[0], size[1], size[2]).asDiagonal();
    t.col(3) = Eigen::Vector3d(move[0], move[1], move[2]);
    return t;
  }

  void add_node(std::size_t index, const Transform& world_from_parent, int depth) {
    if (depth > kDeepestNode) fail("nodes lie more than " + std::to_string(kDeepestNode) + " deep in each other");
    if (++nodes_ > kMostPieces) fail("its nodes hold each other more than a million times");
    const ConfigValue& node = entry("nodes", index);
    const Transform local = transform_of(node);
    Transform world;
    world.leftCols<3>() = world_from_parent.leftCols<3>() * local.leftCols<3>();
    world.col(3) = world_from_parent.leftCols<3>() * local.col(3) + world_from_parent.col(3);
    if (find_member(node, "mesh") != nullptr) add_mesh(entry("meshes", whole(node, "mesh")), world);
    const ConfigValue* const children = find_member(node, "children");
    if (children == nullptr) return;
    for (const ConfigValue& child : children->items) add_node(number_of(child, "a child of a node"), world, depth + 1);
  }

  void add_mesh(const ConfigValue& mesh, const Transform& world) {
    const ConfigValue* const primitives = find_member(mesh, "primitives");
    if (primitives == nullptr) return;
    for (const ConfigValue& primitive : primitives->items) {
      if (whole(primitive, "mode", glb::kTriangles) != glb::kTriangles) continue;  // points, lines, strips
      if (++primitives_ > kMostPieces) fail("there are more than a million pieces of meshes");
      const ConfigValue* const attributes = find_member(primitive, "attributes");
      if (attributes != nullptr && find_member(*attributes, "POSITION") != nullptr)
        add_primitive(primitive, *attributes, world);
    }
  }

  void add_primitive(const ConfigValue& primitive, const ConfigValue& attributes, const Transform& world) {
    const std::size_t first = mesh_.vertices.size();
    read_accessor(whole(attributes, "POSITION"), "VEC3", [&](int component, const std::uint8_t* at) {
      if (component != glb::kFloat) fail("places of vertices are no floats");
      std::array<float, 3> x{};
      std::memcpy(x.data(), at, sizeof(x));
      const Eigen::Vector3d local(static_cast<double>(x[0]), static_cast<double>(x[1]), static_cast<double>(x[2]));
      mesh_.vertices.emplace_back(world.leftCols<3>() * local + world.col(3));
    });
    if (mesh_.vertices.size() > static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max()))
      fail("there are more vertices than can be numbered");
    const std::size_t count = mesh_.vertices.size() - first;
    std::vector<std::int32_t> corners;
    const auto add_corner = [&](std::size_t corner) {
      if (corner >= count)
        fail("a triangle has the corner " + std::to_string(corner) + " of " + std::to_string(count) + " vertices");
      corners.push_back(static_cast<std::int32_t>(first + corner));
    };
    if (find_member(primitive, "indices") != nullptr) {
      read_accessor(whole(primitive, "indices"), "SCALAR",
                    [&](int component, const std::uint8_t* at) { add_corner(index_at(component, at)); });
    } else {
      for (std::size_t i = 0; i < count; ++i) add_corner(i);
    }
    const Matrix3<double> axes = world.leftCols<3>();
    const bool mirrored =
        dot(Vector3<double>(axes.col(0)), cross(Vector3<double>(axes.col(1)), Vector3<double>(axes.col(2)))) < 0;
    for (std::size_t i = 0; i + 2 < corners.size(); i += 3) {
      if (mirrored) std::swap(corners[i + 1], corners[i + 2]);
      detail::add_polygon(std::span(corners).subspan(i, 3), mesh_);
    }
  }

  static std::size_t index_at(int component, const std::uint8_t* at) {
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

  template <class F>
  void read_accessor(std::size_t index, const char* type, F take) const {
    const ConfigValue& accessor = entry("accessors", index);
    const ConfigValue* const its_type = find_member(accessor, "type");
    if (its_type == nullptr || its_type->text != type)
      fail("accessor " + std::to_string(index) + " is not of type " + type);
    if (find_member(accessor, "sparse") != nullptr) fail("sparse accessors are not read");
    const auto component = static_cast<int>(whole(accessor, "componentType"));
    const bool is_vector = std::string_view(type) == "VEC3";
    const std::size_t bytes = component == glb::kUnsignedByte ? 1 : component == glb::kUnsignedShort ? 2 : 4;
    if (component != glb::kFloat && component != glb::kUnsignedByte && component != glb::kUnsignedShort &&
        component != glb::kUnsignedInt)
      fail("accessor " + std::to_string(index) + " has the component type " + std::to_string(component));
    if (!is_vector && component == glb::kFloat) fail("corners of triangles are floats");
    const ConfigValue& view = entry("bufferViews", whole(accessor, "bufferView"));
    if (whole(view, "buffer") != 0) fail("numbers are read of the file's own buffer alone, which is buffer 0");
    const std::size_t element = is_vector ? 3 * bytes : bytes, count = whole(accessor, "count");
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

  std::span<const std::uint8_t> file_, binary_;
  const std::string& name_;
  ConfigValue json_;
  std::size_t nodes_ = 0, primitives_ = 0;
  TriangleMesh mesh_;
};

}  // namespace

TriangleMesh detail::parse_glb_mesh(std::span<const std::uint8_t> file, const std::string& name) {
  return GlbParser(file, name).parse();
}

}  // namespace hsi4d
