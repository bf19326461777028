#include "optim/solid/mesh_topology.h"

#include <algorithm>
#include <map>
#include <numeric>

namespace hsi4d {

namespace {

using Face = std::array<std::int32_t, 3>;

const Vector3<double>& corner_at(const TriangleMesh& mesh, std::int32_t v) {
  return mesh.vertices[static_cast<std::size_t>(v)];
}

/// The edge of a triangle that lies opposite to a vertex.
struct Opposite {
  std::int32_t vertex, from, to;
};

std::vector<Opposite> opposite_edges(const TriangleMesh& mesh) {
  std::vector<Opposite> edges;
  edges.reserve(3 * mesh.faces.size());
  for (const Face& face : mesh.faces) {
    for (std::size_t i = 0; i < 3; ++i) edges.push_back({face[i], face[(i + 1) % 3], face[(i + 2) % 3]});
  }
  std::sort(edges.begin(), edges.end(), [](const Opposite& a, const Opposite& b) {
    return std::tie(a.vertex, a.from, a.to) < std::tie(b.vertex, b.from, b.to);
  });
  return edges;
}

/// Whether the edges opposite to a vertex, sorted, are one closed line that comes through each corner once.
bool is_fan(std::span<const Opposite> edges) {
  for (std::size_t i = 1; i < edges.size(); ++i) {
    if (edges[i].from == edges[i - 1].from) return false;
  }
  std::size_t at = 0;
  for (std::size_t steps = 1; steps <= edges.size(); ++steps) {
    const auto next = std::lower_bound(edges.begin(), edges.end(), edges[at].to,
                                       [](const Opposite& edge, std::int32_t from) { return edge.from < from; });
    if (next == edges.end() || next->from != edges[at].to) return false;
    at = static_cast<std::size_t>(next - edges.begin());
    if (at == 0) return steps == edges.size();
  }
  return false;
}

}  // namespace

std::vector<TriangleMesh> connected_parts(const TriangleMesh& mesh) {
  std::vector<std::int32_t> parent(mesh.vertices.size());
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&parent](std::int32_t v) {
    while (parent[static_cast<std::size_t>(v)] != v) {
      std::int32_t& up = parent[static_cast<std::size_t>(v)];
      up = parent[static_cast<std::size_t>(up)];
      v = up;
    }
    return v;
  };
  for (const Face& face : mesh.faces) {
    for (std::size_t i = 1; i < 3; ++i) parent[static_cast<std::size_t>(root(face[i]))] = root(face[0]);
  }
  std::map<std::int32_t, std::size_t> part_of_root;
  std::vector<TriangleMesh> parts;
  std::vector<std::int32_t> number(mesh.vertices.size(), -1);
  for (Face face : mesh.faces) {
    const auto [entry, is_new] = part_of_root.try_emplace(root(face[0]), parts.size());
    if (is_new) parts.emplace_back();
    TriangleMesh& part = parts[entry->second];
    for (std::int32_t& corner : face) {
      std::int32_t& to = number[static_cast<std::size_t>(corner)];
      if (to < 0) {
        to = static_cast<std::int32_t>(part.vertices.size());
        part.vertices.push_back(corner_at(mesh, corner));
      }
      corner = to;
    }
    part.faces.push_back(face);
  }
  return parts;
}

double signed_volume(const TriangleMesh& mesh) {
  if (mesh.vertices.empty()) return 0;
  const Vector3<double> origin = mesh.vertices.front();
  double sum = 0;
  for (const Face& face : mesh.faces) {
    const Vector3<double> a = corner_at(mesh, face[0]) - origin, b = corner_at(mesh, face[1]) - origin,
                          c = corner_at(mesh, face[2]) - origin;
    sum += dot(a, cross(b, c));
  }
  return sum / 6;
}

std::vector<std::int32_t> bad_vertices(const TriangleMesh& mesh) {
  const std::vector<Opposite> edges = opposite_edges(mesh);
  std::vector<std::int32_t> bad;
  for (std::size_t begin = 0; begin < edges.size();) {
    std::size_t end = begin + 1;
    while (end < edges.size() && edges[end].vertex == edges[begin].vertex) ++end;
    if (!is_fan(std::span(edges).subspan(begin, end - begin))) bad.push_back(edges[begin].vertex);
    begin = end;
  }
  return bad;
}

Index genus(const TriangleMesh& part) {
  const Index faces = std::ssize(part.faces), edges = faces * 3 / 2;
  return 1 - (std::ssize(part.vertices) - edges + faces) / 2;
}

}  // namespace hsi4d
