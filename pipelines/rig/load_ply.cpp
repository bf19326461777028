// Meshes in PLY: colours of vertices; places in textures that "comment TextureFile NAME" names, of vertices or, as
// MeshLab writes them, of corners.
#include <cmath>

#include "core/check.h"
#include "core/log.h"
#include "core/text.h"
#include "pipelines/rig/loaded_mesh.h"
#include "splat/files/ply_table.h"

namespace hsi4d {

namespace {

/// Where properties are; -1: there are none of that name.
struct PlyColumns {
  std::array<int, 3> place = {-1, -1, -1}, normal = {-1, -1, -1}, color = {-1, -1, -1};
  std::array<int, 2> uv = {-1, -1};
  float color_unit = 1;  ///< what the largest colour is
};

template <std::size_t N>
std::array<int, N> columns_named(const PlyElement& element, const std::array<const char*, N>& names) {
  std::array<int, N> columns;
  for (std::size_t i = 0; i < N; ++i) {
    columns[i] = element.find(names[i]);
    const bool is_number =
        columns[i] >= 0 && !element.properties[static_cast<std::size_t>(columns[i])].count_type.has_value();
    if (!is_number)
      return [] {
        std::array<int, N> none;
        none.fill(-1);
        return none;
      }();
  }
  return columns;
}

float unit_of(PlyType type) {
  if (type == PlyType::kUint8 || type == PlyType::kInt8) return 255;
  return type == PlyType::kUint16 || type == PlyType::kInt16 ? 65535 : 1;
}

PlyColumns columns_of(const PlyElement& vertex, const std::string& name) {
  PlyColumns columns;
  columns.place = columns_named<3>(vertex, {"x", "y", "z"});
  if (columns.place[0] < 0) throw DataError(name + ": element \"vertex\" has no numbers \"x\", \"y\", \"z\"");
  columns.normal = columns_named<3>(vertex, {"nx", "ny", "nz"});
  columns.color = columns_named<3>(vertex, {"red", "green", "blue"});
  for (const auto& [u, v] : {std::pair{"s", "t"}, {"u", "v"}, {"texture_u", "texture_v"}}) {
    if (columns.uv[0] < 0) columns.uv = columns_named<2>(vertex, {u, v});
  }
  if (columns.color[0] >= 0)
    columns.color_unit = unit_of(vertex.properties[static_cast<std::size_t>(columns.color[0])].type);
  return columns;
}

class PlyLoader {
 public:
  PlyLoader(std::span<const std::uint8_t> file, const std::string& name)
      : file_(file), name_(name), header_(read_ply_header(file, name)) {
    vertex_ = header_.find("vertex");
    face_ = header_.find("face");
    if (vertex_ < 0) throw DataError(name + ": there is no element \"vertex\"");
    if (face_ < 0) throw DataError(name + ": there is no element \"face\": these are points, not a mesh");
  }

  LoadedMesh load() {
    take_materials();
    take_vertices();
    const std::vector<std::vector<double>> uvs = lists_of({"texcoord"});
    const std::vector<std::vector<double>> textures = lists_of({"texnumber"});
    const std::vector<std::vector<double>> corners = lists_of({"vertex_indices", "vertex_index"});
    if (corners.empty()) throw DataError(name_ + ": element \"face\" has no list \"vertex_indices\"");
    for (std::size_t f = 0; f < corners.size(); ++f) {
      std::vector<std::int32_t> polygon = vertices_of(corners[f], f);
      if (!uvs.empty() && uvs[f].size() == 2 * polygon.size()) polygon = with_own_uvs(polygon, uvs[f]);
      const double texture = textures.empty() || textures[f].empty() ? 0 : textures[f][0];
      const auto last = static_cast<double>(mesh_.materials.size() - 1);
      const auto material = static_cast<std::size_t>(texture >= 0 && texture <= last ? texture : 0);
      for (std::size_t i = 2; i < polygon.size(); ++i)
        add_face(mesh_, {polygon[0], polygon[i - 1], polygon[i]}, material);
    }
    return std::move(mesh_);
  }

 private:
  /// One material for each texture.
  void take_materials() {
    constexpr std::string_view kTexture = "TextureFile ";
    for (const std::string& comment : header_.comments) {
      if (!comment.starts_with(kTexture)) continue;
      mesh_.materials.emplace_back().texture = add_texture(mesh_, comment.substr(kTexture.size()));
    }
    if (mesh_.materials.empty()) mesh_.materials.emplace_back();
  }

  void take_vertices() {
    const PlyColumns columns = columns_of(header_.elements[static_cast<std::size_t>(vertex_)], name_);
    std::vector<int> asked;
    const auto ask = [&asked](const auto& group) {
      if (group[0] >= 0) asked.insert(asked.end(), group.begin(), group.end());
    };
    ask(columns.place);
    ask(columns.normal);
    ask(columns.color);
    ask(columns.uv);
    read_ply_rows(file_, header_, name_, vertex_, asked, [&](Index, std::span<const double> values) {
      add_vertex(mesh_, Vector3<double>(values[0], values[1], values[2]));
      std::size_t at = 3;
      if (columns.normal[0] >= 0) {
        for (float& x : mesh_.normals.back()) x = static_cast<float>(values[at++]);
      }
      if (columns.color[0] >= 0) {
        for (std::size_t c = 0; c < 3; ++c)
          mesh_.colors.back()[c] = static_cast<float>(values[at++]) / columns.color_unit;
      }
      if (columns.uv[0] >= 0) {
        for (float& x : mesh_.uvs.back()) x = static_cast<float>(values[at++]);
      }
    });
  }

  /// The numbers of a property of all faces; none where there is no property of these names.
  std::vector<std::vector<double>> lists_of(std::initializer_list<const char*> names) const {
    const PlyElement& face = header_.elements[static_cast<std::size_t>(face_)];
    int column = -1;
    for (const char* name : names) column = std::max(column, face.find(name));
    std::vector<std::vector<double>> all;
    if (column < 0) return all;
    read_ply_lists(file_, header_, name_, face_, column,
                   [&](Index, std::span<const double> numbers) { all.emplace_back(numbers.begin(), numbers.end()); });
    return all;
  }

  std::vector<std::int32_t> vertices_of(const std::vector<double>& corners, std::size_t face) const {
    std::vector<std::int32_t> polygon;
    const auto count = static_cast<double>(header_.elements[static_cast<std::size_t>(vertex_)].rows);
    for (const double corner : corners) {
      if (!(corner >= 0 && corner < count) || corner != std::floor(corner))
        throw DataError(name_ + ": face " + std::to_string(face) + " has the corner " + number_text(corner) +
                        "; the file has " + number_text(count) + " vertices");
      polygon.push_back(static_cast<std::int32_t>(corner));
    }
    return polygon;
  }

  /// Vertices of the same places that are the corners of one face.
  std::vector<std::int32_t> with_own_uvs(const std::vector<std::int32_t>& polygon, const std::vector<double>& uvs) {
    std::vector<std::int32_t> own;
    for (std::size_t k = 0; k < polygon.size(); ++k) {
      const auto from = static_cast<std::size_t>(polygon[k]);
      const Vector3<double> place = mesh_.places[from];
      own.push_back(add_vertex(mesh_, place));
      mesh_.normals.back() = mesh_.normals[from];
      mesh_.colors.back() = mesh_.colors[from];
      mesh_.uvs.back() = {static_cast<float>(uvs[2 * k]), static_cast<float>(uvs[2 * k + 1])};
    }
    return own;
  }

  std::span<const std::uint8_t> file_;
  const std::string& name_;
  PlyHeader header_;
  int vertex_ = -1, face_ = -1;
  LoadedMesh mesh_;
};

}  // namespace

LoadedMesh load_ply(std::span<const std::uint8_t> file, const std::string& name) {
  return PlyLoader(file, name).load();
}

}  // namespace hsi4d
