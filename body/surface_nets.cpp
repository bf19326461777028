#include "body/surface_nets.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/check.h"

namespace hsi4d::detail {

namespace {

using Vector = Vector3<double>;
using DistanceField = FunctionRef<double(const Vector&)>;
using Map = FunctionRef<Vector(const Vector&)>;

/// Values of the field at the nodes, each computed when first asked for.
class Nodes {
 public:
  Nodes(const NetGrid& grid, Map map, DistanceField field)
      : grid_(grid), map_(map), field_(field), values_(count(), std::numeric_limits<double>::quiet_NaN()) {}

  std::size_t count() const {
    return static_cast<std::size_t>(grid_.nodes[0]) * static_cast<std::size_t>(grid_.nodes[1]) *
           static_cast<std::size_t>(grid_.nodes[2]);
  }
  /// Distance in number from a node to the next along an axis.
  std::size_t step(int axis) const {
    if (axis == 2) return 1;
    return static_cast<std::size_t>(grid_.nodes[2]) * (axis == 1 ? 1 : static_cast<std::size_t>(grid_.nodes[1]));
  }
  std::array<int, 3> place(std::size_t node) const {
    return {static_cast<int>(node / step(0)), static_cast<int>(node % step(0) / step(1)),
            static_cast<int>(node % step(1))};
  }
  Vector position(std::size_t node) const {
    const std::array<int, 3> at = place(node);
    return grid_.low + Vector(at[0], at[1], at[2]) * grid_.cell;
  }
  double value(std::size_t node) {
    double& value = values_[node];
    if (std::isnan(value)) value = field_(map_(position(node)));
    return value;
  }
  /// Number of corner `k` of a cell (its node at the low end): bit a of k goes up along axis a.
  std::size_t corner(std::size_t cell, int k) const {
    return cell + (k & 1 ? step(0) : 0) + (k & 2 ? step(1) : 0) + (k & 4 ? step(2) : 0);
  }
  /// Which corners of a cell are inside.
  unsigned inside(std::size_t cell) {
    unsigned mask = 0;
    for (int k = 0; k < 8; ++k) mask |= value(corner(cell, k)) < 0 ? 1U << k : 0U;
    return mask;
  }
  bool border(std::size_t cell) const {
    const std::array<int, 3> at = place(cell);
    for (int a = 0; a < 3; ++a) {
      const std::size_t i = static_cast<std::size_t>(a);
      if (at[i] <= 0 || at[i] >= grid_.nodes[i] - 2) return true;
    }
    return false;
  }

 private:
  const NetGrid& grid_;
  Map map_;
  DistanceField field_;
  std::vector<double> values_;
};

/// The corners of a cell on its face at the low (side 0) or high end of an axis.
unsigned face_mask(int axis, int side) {
  unsigned mask = 0;
  for (int k = 0; k < 8; ++k) mask |= (k >> axis & 1) == side ? 1U << k : 0U;
  return mask;
}

/// The cells that the surface crosses, ascending.
std::vector<std::size_t> crossed_cells(Nodes& nodes, const NetGrid& grid, const Vector& inside) {
  std::array<int, 3> at;
  for (int a = 0; a < 3; ++a) {
    at[static_cast<std::size_t>(a)] = static_cast<int>(std::floor((inside[a] - grid.low[a]) / grid.cell));
  }
  std::size_t cell = static_cast<std::size_t>(at[0]) * nodes.step(0) + static_cast<std::size_t>(at[1]) * nodes.step(1) +
                     static_cast<std::size_t>(at[2]);
  HSI4D_CHECK(nodes.value(cell) < 0, "the point that should be inside is not");
  while (nodes.inside(cell) == 255) cell += nodes.step(2);
  std::vector<char> met(nodes.count(), 0);
  std::vector<std::size_t> cells = {cell};
  met[cell] = 1;
  for (std::size_t next = 0; next < cells.size(); ++next) {
    const std::size_t here = cells[next];
    HSI4D_CHECK(!nodes.border(here), "the surface leaves the grid");
    const unsigned mask = nodes.inside(here);
    for (int face = 0; face < 6; ++face) {
      const int axis = face / 2, side = face % 2;
      const unsigned on_face = face_mask(axis, side);
      if ((mask & on_face) == 0 || (mask & on_face) == on_face) continue;
      const std::size_t there = side == 0 ? here - nodes.step(axis) : here + nodes.step(axis);
      if (met[there] == 0) cells.push_back(there);
      met[there] = 1;
    }
  }
  std::sort(cells.begin(), cells.end());
  return cells;
}

/// Mean of the crossings of a cell's edges, in the grid's space.
Vector cell_vertex(Nodes& nodes, std::size_t cell) {
  Vector sum = Vector::Zero();
  int crossings = 0;
  for (int k = 0; k < 8; ++k) {
    for (int axis = 0; axis < 3; ++axis) {
      if (k >> axis & 1) continue;
      const std::size_t a = nodes.corner(cell, k), b = a + nodes.step(axis);
      const double va = nodes.value(a), vb = nodes.value(b);
      if ((va < 0) == (vb < 0)) continue;
      sum += nodes.position(a) + (nodes.position(b) - nodes.position(a)) * (va / (va - vb));
      ++crossings;
    }
  }
  return sum / crossings;
}

/// Two triangles, cut along the shorter diagonal.
void add_quadrangle(const std::array<std::int32_t, 4>& q, NetMesh& mesh) {
  const auto squared = [&](std::size_t i, std::size_t j) {
    const Vector d = mesh.vertices[static_cast<std::size_t>(q[i])] - mesh.vertices[static_cast<std::size_t>(q[j])];
    return dot(d, d);
  };
  if (squared(0, 2) <= squared(1, 3)) {
    mesh.faces.insert(mesh.faces.end(), {q[0], q[1], q[2], q[0], q[2], q[3]});
  } else {
    mesh.faces.insert(mesh.faces.end(), {q[0], q[1], q[3], q[1], q[2], q[3]});
  }
}

Vector gradient(DistanceField field, const Vector& p) {
  constexpr double kStep = 1e-4;
  Vector g;
  for (int i = 0; i < 3; ++i) {
    Vector plus = p, minus = p;
    plus[i] += kStep, minus[i] -= kStep;
    g[i] = (field(plus) - field(minus)) / (2 * kStep);
  }
  return g;
}

/// Newton's steps along the gradient, each of 3 mm at most.
Vector onto_surface(DistanceField field, Vector p) {
  constexpr double kLongest = 0.003;
  for (int step = 0; step < 3; ++step) {
    const Vector g = gradient(field, p);
    const double squared = dot(g, g);
    if (!(squared > 1e-4)) return p;
    Vector move = g * (-field(p) / squared);
    const double length = std::sqrt(dot(move, move));
    if (length > kLongest) move *= kLongest / length;
    p += move;
  }
  return p;
}

/// Moves each vertex half way to the mean of its neighbours, as far as that is along the surface.
void even_out(DistanceField field, const VertexNeighbours& around, std::vector<Vector>& vertices) {
  std::vector<Vector> moved(vertices.size());
  for (std::size_t v = 0; v < vertices.size(); ++v) {
    Vector mean = Vector::Zero();
    for (Index i = around.begin[v]; i < around.begin[v + 1]; ++i) {
      mean += vertices[static_cast<std::size_t>(around.neighbours[static_cast<std::size_t>(i)])];
    }
    mean /= static_cast<double>(around.begin[v + 1] - around.begin[v]);
    const Direction<double, 3> normal = direction_of(gradient(field, vertices[v]));
    const Vector move = (mean - vertices[v]) * 0.5;
    moved[v] = onto_surface(field, vertices[v] + move - normal.unit * dot(normal.unit, move));
  }
  vertices = std::move(moved);
}

}  // namespace

VertexNeighbours vertex_neighbours(Index vertices, const std::vector<std::int32_t>& faces) {
  std::vector<std::pair<std::int32_t, std::int32_t>> edges;
  edges.reserve(2 * faces.size());
  for (std::size_t f = 0; f < faces.size(); f += 3) {
    for (std::size_t i = 0; i < 3; ++i) {
      edges.emplace_back(faces[f + i], faces[f + (i + 1) % 3]);
      edges.emplace_back(faces[f + (i + 1) % 3], faces[f + i]);
    }
  }
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  VertexNeighbours around;
  around.begin.assign(static_cast<std::size_t>(vertices) + 1, 0);
  for (const auto& edge : edges) {
    ++around.begin[static_cast<std::size_t>(edge.first) + 1];
    around.neighbours.push_back(edge.second);
  }
  for (std::size_t v = 0; v < static_cast<std::size_t>(vertices); ++v) around.begin[v + 1] += around.begin[v];
  return around;
}

NetMesh surface_net(const NetGrid& grid, Map map, DistanceField field, const Vector3<double>& inside) {
  Nodes nodes(grid, map, field);
  const std::vector<std::size_t> cells = crossed_cells(nodes, grid, inside);
  std::vector<std::int32_t> vertex_of(nodes.count(), -1);
  NetMesh mesh;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    vertex_of[cells[i]] = static_cast<std::int32_t>(i);
    mesh.vertices.push_back(onto_surface(field, map(cell_vertex(nodes, cells[i]))));
  }
  for (const std::size_t cell :
       cells) {  // the three edges from its low node; the four cells around each are crossed too
    for (int axis = 0; axis < 3; ++axis) {
      const bool from_inside = nodes.value(cell) < 0;
      if (from_inside == (nodes.value(cell + nodes.step(axis)) < 0)) continue;
      const std::size_t u = nodes.step((axis + 1) % 3), v = nodes.step((axis + 2) % 3);
      std::array<std::int32_t, 4> q = {vertex_of[cell], vertex_of[cell - u], vertex_of[cell - u - v],
                                       vertex_of[cell - v]};
      if (!from_inside) std::swap(q[1], q[3]);
      add_quadrangle(q, mesh);
    }
  }
  const VertexNeighbours around = vertex_neighbours(static_cast<Index>(mesh.vertices.size()), mesh.faces);
  for (int round = 0; round < 2; ++round) even_out(field, around, mesh.vertices);
  return mesh;
}

}  // namespace hsi4d::detail
