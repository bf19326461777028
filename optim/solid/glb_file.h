// What a binary glTF file holds: its JSON, its numbers, its triangles placed by nodes.
// [glTF 2.0, Khronos Group: chapters 3.6, 3.7, 4]
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/config_value.h"
#include "core/linear.h"

namespace hsi4d {

/// Triangles of a mesh, as they stand in the scene.
struct GlbPrimitive {
  const ConfigValue& json;        ///< the entry of "primitives"
  const ConfigValue& attributes;  ///< its "attributes", which have POSITION
  std::vector<Vector3<double>> vertices;
  std::vector<std::array<std::int32_t, 3>> faces;  ///< counter-clockwise seen from the front, mirrored or not
  Matrix3<double> axes;                            ///< of the vertices: scene from mesh, without its place
};

/// A .glb file in memory, which stays there. All of its functions throw DataError naming the file and what is wrong.
class GlbFile {
 public:
  GlbFile(std::span<const std::uint8_t> file, const std::string& name);

  [[noreturn]] void fail(const std::string& problem) const;

  /// Hands over all triangles of the scene, turned to z up: (x, y, z) becomes (x, −z, y). Points, lines and strips are
  /// passed over.
  void each_primitive(const std::function<void(const GlbPrimitive&)>& take) const;

  const ConfigValue& json() const { return json_; }
  /// Entry `i` of a list at the top: "materials".
  const ConfigValue& entry(const char* what, std::size_t i) const;
  /// A whole number, 0 or more.
  std::size_t whole(const ConfigValue& object, const char* key, std::optional<std::size_t> otherwise = {}) const;
  std::vector<double> numbers(const ConfigValue& object, const char* key, std::vector<double> otherwise) const;
  double numbers(const ConfigValue& object, const char* key, double otherwise) const;
  /// The bytes of a buffer view.
  std::span<const std::uint8_t> view_bytes(std::size_t view) const;
  /// The rows of an accessor, `columns` numbers each; whole numbers are shares of their type's largest.
  std::vector<float> rows(std::size_t accessor, const char* type, std::size_t columns) const;

 private:
  using Transform = Eigen::Matrix<double, 3, 4>;
  using Take = std::function<void(const GlbPrimitive&)>;
  struct Counts {
    std::size_t nodes = 0, primitives = 0;
  };

  std::uint32_t word_at(std::size_t at) const;
  void read_chunks();
  void parse_json(std::span<const std::uint8_t> chunk);
  double number(const ConfigValue& value, const char* what) const;
  std::size_t number_of(const ConfigValue& value, const char* what) const;
  const ConfigValue& item(const ConfigValue& array, const char* what, std::size_t i) const;
  Transform transform_of(const ConfigValue& node) const;
  void add_node(std::size_t index, const Transform& world_from_parent, int depth, Counts& counts,
                const Take& take) const;
  void add_mesh(const ConfigValue& mesh, const Transform& world, Counts& counts, const Take& take) const;
  GlbPrimitive primitive_of(const ConfigValue& json, const ConfigValue& attributes, const Transform& world) const;
  std::vector<std::size_t> corners_of(const ConfigValue& primitive, std::size_t vertices) const;
  void read_accessor(std::size_t index, const char* type,
                     const std::function<void(int component, const std::uint8_t* at)>& take) const;

  std::span<const std::uint8_t> file_, binary_;
  std::string name_;
  ConfigValue json_;
};

}  // namespace hsi4d
