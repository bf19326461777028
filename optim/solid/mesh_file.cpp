#include "optim/solid/mesh_file.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <string_view>
#include <tuple>

#include "core/check.h"
#include "core/file.h"
#include "core/text.h"
#include "splat/files/ply_table.h"

namespace hsi4d {

namespace {

constexpr std::size_t kMostVertices = std::numeric_limits<std::int32_t>::max();

// --- OBJ -------------------------------------------------------------------------------------------------------------

/// Reads the lines of an OBJ file that say where vertices and faces are.
class ObjParser {
 public:
  ObjParser(std::string_view text, const std::string& name) : text_(text), name_(name) {}

  TriangleMesh parse() {
    while (!text_.empty()) {
      const std::size_t end = std::min(text_.find('\n'), text_.size());
      ++line_;
      left_ = text_.substr(0, end);
      text_.remove_prefix(std::min(end + 1, text_.size()));
      const std::string_view keyword = word();
      if (keyword == "v") add_vertex();
      if (keyword == "f") add_face();
    }
    return std::move(mesh_);
  }

 private:
  static bool is_space(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f'; }

  std::string_view word() {
    std::size_t begin = 0;
    while (begin < left_.size() && is_space(left_[begin])) ++begin;
    std::size_t end = begin;
    while (end < left_.size() && !is_space(left_[end])) ++end;
    const std::string_view found = left_.substr(begin, end - begin);
    left_.remove_prefix(end);
    return found.starts_with('#') ? std::string_view() : found;
  }

  void add_vertex() {
    if (mesh_.vertices.size() >= kMostVertices) fail("there are more vertices than can be numbered");
    Vector3<double> vertex;
    for (int i = 0; i < 3; ++i) {
      const std::string_view text = word();
      const std::string_view digits = text.starts_with('+') ? text.substr(1) : text;
      const auto read = std::from_chars(digits.data(), digits.data() + digits.size(), vertex[i]);
      if (read.ec != std::errc() || read.ptr != digits.data() + digits.size())
        fail("a vertex has three numbers, not \"" + with_escapes(text) + "\"");
    }
    mesh_.vertices.push_back(vertex);
  }

  /// "7", "7/1", "7//3", "7/1/3", from 1, or from the last vertex backwards below 0.
  void add_face() {
    corners_.clear();
    for (std::string_view text = word(); !text.empty(); text = word()) {
      const std::string_view digits = text.substr(0, text.find('/'));
      std::int64_t number = 0;
      const auto read = std::from_chars(digits.data(), digits.data() + digits.size(), number);
      const auto count = static_cast<std::int64_t>(mesh_.vertices.size());
      if (read.ec != std::errc() || read.ptr != digits.data() + digits.size() || number == 0 || number > count ||
          number < -count)
        fail("a corner is a vertex from 1 to " + std::to_string(count) + ", not \"" + with_escapes(text) + "\"");
      corners_.push_back(static_cast<std::int32_t>(number > 0 ? number - 1 : count + number));
    }
    if (corners_.size() < 3) fail("a face has three corners at least, not " + std::to_string(corners_.size()));
    detail::add_polygon(corners_, mesh_);
  }

  [[noreturn]] void fail(const std::string& problem) const {
    throw DataError(name_ + ":" + std::to_string(line_) + ": " + problem);
  }

  std::string_view text_, left_;
  const std::string& name_;
  int line_ = 0;
  std::vector<std::int32_t> corners_;
  TriangleMesh mesh_;
};

// --- PLY -------------------------------------------------------------------------------------------------------------

std::array<int, 3> coordinate_columns(const PlyElement& vertex, const std::string& name) {
  std::array<int, 3> columns{};
  for (std::size_t i = 0; i < 3; ++i) {
    const std::string property(1, static_cast<char>('x' + i));
    columns[i] = vertex.find(property);
    if (columns[i] < 0 || vertex.properties[static_cast<std::size_t>(columns[i])].count_type)
      throw DataError(name + ": element \"vertex\" has no number \"" + property + "\"");
  }
  return columns;
}

int corners_column(const PlyElement& face, const std::string& name) {
  const int column = std::max(face.find("vertex_indices"), face.find("vertex_index"));
  if (column < 0 || !face.properties[static_cast<std::size_t>(column)].count_type)
    throw DataError(name + ": element \"face\" has no list \"vertex_indices\"");
  return column;
}

TriangleMesh parse_ply_mesh(std::span<const std::uint8_t> file, const std::string& name) {
  const PlyHeader header = read_ply_header(file, name);
  const int vertex = header.find("vertex"), face = header.find("face");
  if (vertex < 0) throw DataError(name + ": there is no element \"vertex\"");
  if (face < 0) throw DataError(name + ": there is no element \"face\": these are points, not a mesh");
  TriangleMesh mesh;
  read_ply_rows(file, header, name, vertex, coordinate_columns(header.elements[static_cast<std::size_t>(vertex)], name),
                [&](Index, std::span<const double> x) { mesh.vertices.emplace_back(x[0], x[1], x[2]); });
  std::vector<std::int32_t> corners;
  const auto count = static_cast<double>(std::min(mesh.vertices.size(), kMostVertices));
  read_ply_lists(file, header, name, face, corners_column(header.elements[static_cast<std::size_t>(face)], name),
                 [&](Index row, std::span<const double> numbers) {
                   corners.clear();
                   for (const double number : numbers) {
                     if (!(number >= 0 && number < count) || number != std::floor(number))
                       throw DataError(name + ": face " + std::to_string(row) + " has the corner " +
                                       number_text(number) + "; the file has " + std::to_string(mesh.vertices.size()) +
                                       " vertices");
                     corners.push_back(static_cast<std::int32_t>(number));
                   }
                   detail::add_polygon(corners, mesh);
                 });
  return mesh;
}

// --- cleaning --------------------------------------------------------------------------------------------------------

void check_mesh(const TriangleMesh& mesh, const std::string& name) {
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    for (int i = 0; i < 3; ++i) {
      const double x = mesh.vertices[v][i];
      if (std::fabs(x) <= kFarthestVertex) continue;
      throw DataError(name + ": vertex " + std::to_string(v) + " has the coordinate " + number_text(x) +
                      "; allowed are numbers from -1e6 to 1e6");
    }
  }
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    for (const std::int32_t corner : mesh.faces[f]) {
      if (corner >= 0 && static_cast<std::size_t>(corner) < mesh.vertices.size()) continue;
      throw DataError(name + ": face " + std::to_string(f) + " has the corner " + std::to_string(corner) +
                      "; there are " + std::to_string(mesh.vertices.size()) + " vertices");
    }
  }
  if (mesh.faces.empty()) throw DataError(name + ": the mesh has no faces");
}

/// For each vertex the first one at its place.
std::vector<std::int32_t> first_at_place(const std::vector<Vector3<double>>& vertices) {
  const auto place = [&](std::int32_t v) {
    const Vector3<double>& x = vertices[static_cast<std::size_t>(v)];
    return std::tuple(x[0] + 0.0, x[1] + 0.0, x[2] + 0.0);  // −0 is 0
  };
  std::vector<std::int32_t> order(vertices.size()), first(vertices.size());
  for (std::size_t v = 0; v < order.size(); ++v) order[v] = static_cast<std::int32_t>(v);
  std::sort(order.begin(), order.end(),
            [&](std::int32_t a, std::int32_t b) { return std::tuple(place(a), a) < std::tuple(place(b), b); });
  for (std::size_t i = 0; i < order.size(); ++i) {
    const bool same = i > 0 && place(order[i]) == place(order[i - 1]);
    first[static_cast<std::size_t>(order[i])] = same ? first[static_cast<std::size_t>(order[i - 1])] : order[i];
  }
  return first;
}

bool has_area(const TriangleMesh& mesh, const std::array<std::int32_t, 3>& face) {
  const auto at = [&](std::size_t i) -> const Vector3<double>& {
    return mesh.vertices[static_cast<std::size_t>(face[i])];
  };
  const Vector3<double> normal = cross(Vector3<double>(at(1) - at(0)), Vector3<double>(at(2) - at(0)));
  return dot(normal, normal) > 0;
}

}  // namespace

void detail::add_polygon(std::span<const std::int32_t> corners, TriangleMesh& mesh) {
  for (std::size_t i = 2; i < corners.size(); ++i) mesh.faces.push_back({corners[0], corners[i - 1], corners[i]});
}

std::string mesh_ending(const std::string& path) {
  const std::size_t dot_at = path.rfind('.');
  std::string ending = dot_at == std::string::npos ? "" : path.substr(dot_at);
  for (char& c : ending) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  if (ending != ".obj" && ending != ".ply" && ending != ".glb")
    throw UserError(path + ": a mesh ends in .obj, .ply or .glb");
  return ending;
}

TriangleMesh cleaned(const TriangleMesh& mesh, const std::string& name) {
  check_mesh(mesh, name);
  const std::vector<std::int32_t> first = first_at_place(mesh.vertices);
  std::vector<std::int32_t> number(mesh.vertices.size(), -1);  // in the result
  TriangleMesh clean;
  for (std::array<std::int32_t, 3> face : mesh.faces) {
    for (std::int32_t& corner : face) corner = first[static_cast<std::size_t>(corner)];
    if (!has_area(mesh, face)) continue;
    for (std::int32_t& corner : face) {
      std::int32_t& to = number[static_cast<std::size_t>(corner)];
      if (to < 0) {
        to = static_cast<std::int32_t>(clean.vertices.size());
        clean.vertices.push_back(mesh.vertices[static_cast<std::size_t>(corner)]);
      }
      corner = to;
    }
    clean.faces.push_back(face);
  }
  if (clean.faces.empty())
    throw DataError(name + ": none of the mesh's " + std::to_string(mesh.faces.size()) + " triangles has an area");
  return clean;
}

TriangleMesh parse_mesh(std::span<const std::uint8_t> file, const std::string& name) {
  const std::string ending = mesh_ending(name);
  if (ending == ".obj")
    return cleaned(ObjParser({reinterpret_cast<const char*>(file.data()), file.size()}, name).parse(), name);
  if (ending == ".ply") return cleaned(parse_ply_mesh(file, name), name);
  return cleaned(detail::parse_glb_mesh(file, name), name);
}

TriangleMesh read_mesh(const std::string& path) { return parse_mesh(read_file(path), path); }

}  // namespace hsi4d
