#include "optim/solid/mesh_distance.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_map>

#include "body/surface_index.h"
#include "core/check.h"
#include "core/log.h"
#include "optim/solid/mesh_topology.h"

namespace hsi4d {

namespace {

using Point = Vector3<double>;
using Face = std::array<std::int32_t, 3>;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

std::uint64_t edge_key(std::int32_t a, std::int32_t b) {
  const auto [low, high] = std::minmax(a, b);
  return static_cast<std::uint64_t>(low) << 32U | static_cast<std::uint64_t>(high);
}

/// An edge: the sum of its faces' normals, and how many run along it one way more than the other.
struct Edge {
  Point normal = Point::Zero();
  int surplus = 0;
};
using Edges = std::unordered_map<std::uint64_t, Edge>;

const Point& vertex_of(const TriangleMesh& mesh, std::int32_t v) { return mesh.vertices[static_cast<std::size_t>(v)]; }

Point unit_normal(const TriangleMesh& mesh, const Face& face) {
  const Point& a = vertex_of(mesh, face[0]);
  return direction_of(cross(Point(vertex_of(mesh, face[1]) - a), Point(vertex_of(mesh, face[2]) - a))).unit;
}

Edges edges_of(const TriangleMesh& mesh) {
  Edges edges;
  for (const Face& face : mesh.faces) {
    const Point normal = unit_normal(mesh, face);
    for (std::size_t i = 0; i < 3; ++i) {
      const std::int32_t a = face[i], b = face[(i + 1) % 3];
      Edge& edge = edges[edge_key(a, b)];
      edge.normal += normal;
      edge.surplus += a < b ? 1 : -1;
    }
  }
  return edges;
}

Index count_open(const Edges& edges) {
  return std::count_if(edges.begin(), edges.end(), [](const auto& entry) { return entry.second.surplus != 0; });
}

/// A box with sides along the axes.
struct PieceBox {
  Point low = Point::Constant(kInfinity), high = Point::Constant(-kInfinity);

  void add(const Point& p) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  bool holds(const PieceBox& other) const {
    return (low.array() <= other.low.array()).all() && (high.array() >= other.high.array()).all();
  }
  double distance(const Point& p) const { return (low - p).cwiseMax(p - high).cwiseMax(0.0).norm(); }
};

void append(const TriangleMesh& more, TriangleMesh& mesh) {
  const auto first = static_cast<std::int32_t>(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), more.vertices.begin(), more.vertices.end());
  for (const Face& face : more.faces) mesh.faces.push_back({face[0] + first, face[1] + first, face[2] + first});
}

/// Solids, each with its hollows; surfaces that are open; hollows without a solid.
std::vector<TriangleMesh> solids_of(const TriangleMesh& mesh) {
  struct Part {
    TriangleMesh mesh;
    PieceBox box;
    double volume = 0;
    bool is_open = false;
  };
  std::vector<Part> parts;
  for (TriangleMesh& part : connected_parts(mesh)) {
    Part entry;
    for (const Point& vertex : part.vertices) entry.box.add(vertex);
    entry.is_open = count_open(edges_of(part)) > 0;
    entry.volume = signed_volume(part);
    entry.mesh = std::move(part);
    parts.push_back(std::move(entry));
  }
  std::vector<TriangleMesh> solids;
  TriangleMesh everything;  // in which hollows without a solid are
  std::vector<std::size_t> solid_of_part(parts.size());
  const auto is_hollow = [](const Part& part) { return !part.is_open && part.volume < 0; };
  for (std::size_t i = 0; i < parts.size(); ++i) {
    solid_of_part[i] = solids.size();
    if (!is_hollow(parts[i])) solids.push_back(parts[i].mesh);
  }
  for (const Part& hollow : parts) {
    if (!is_hollow(hollow)) continue;
    std::size_t holder = parts.size();
    for (std::size_t i = 0; i < parts.size(); ++i) {
      const Part& part = parts[i];
      if (part.is_open || is_hollow(part) || !part.box.holds(hollow.box)) continue;
      if (holder == parts.size() || part.volume < parts[holder].volume) holder = i;
    }
    append(hollow.mesh, holder < parts.size() ? solids[solid_of_part[holder]] : everything);
  }
  if (!everything.faces.empty()) solids.push_back(everything);
  return solids;
}

/// Normals of the corners, by the angles of the faces around.
std::vector<Point> corner_normals(const TriangleMesh& mesh) {
  std::vector<Point> normals(mesh.vertices.size(), Point::Zero());
  for (const Face& face : mesh.faces) {
    const Point normal = unit_normal(mesh, face);
    for (std::size_t i = 0; i < 3; ++i) {
      const Point& at = vertex_of(mesh, face[i]);
      const Point a = direction_of(Point(vertex_of(mesh, face[(i + 1) % 3]) - at)).unit,
                  b = direction_of(Point(vertex_of(mesh, face[(i + 2) % 3]) - at)).unit;
      normals[static_cast<std::size_t>(face[i])] += normal * std::atan2(cross(a, b).norm(), dot(a, b));
    }
  }
  return normals;
}

BodyModel surface_of(const TriangleMesh& mesh) {
  BodyModel surface;
  for (const Point& vertex : mesh.vertices) {
    for (int i = 0; i < 3; ++i) surface.vertices.push_back(static_cast<float>(vertex[i]));
  }
  for (const Face& face : mesh.faces) surface.faces.insert(surface.faces.end(), face.begin(), face.end());
  return surface;
}

}  // namespace

MeshEdges count_edges(const TriangleMesh& mesh) {
  const Edges edges = edges_of(mesh);
  return {static_cast<Index>(edges.size()), count_open(edges)};
}

/// One solid, or one open surface.
struct MeshDistance::Piece {
  TriangleMesh mesh;
  Edges edges;
  std::vector<Point> normals;   // of corners
  std::vector<bool> is_border;  // of corners: on an open edge
  bool is_open = false;
  bool is_outside_solid;  // a hollow without a solid
  double thickness;
  PieceBox box;
  BodyModel surface;
  SurfaceIndex index;

  Piece(TriangleMesh mesh_, double thickness_)
      : mesh(std::move(mesh_)),
        edges(edges_of(mesh)),
        normals(corner_normals(mesh)),
        is_border(mesh.vertices.size(), false),
        is_outside_solid(signed_volume(mesh) < 0),
        thickness(thickness_),
        surface(surface_of(mesh)),
        index(surface) {
    for (const Point& vertex : mesh.vertices) box.add(vertex);
    for (const auto& [key, edge] : edges) {
      if (edge.surplus == 0) continue;
      is_open = true;
      is_border[static_cast<std::size_t>(key >> 32U)] = is_border[static_cast<std::size_t>(key & 0xFFFFFFFFU)] = true;
    }
    is_outside_solid = is_outside_solid && !is_open;
  }

  struct Feature {
    Point normal;
    bool is_border;
  };
  Feature feature_at(const SurfacePlace& place) const {
    const Face& face = mesh.faces[static_cast<std::size_t>(place.face)];
    std::array<std::int32_t, 3> corners{};
    std::size_t count = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      if (place.shares[i] > 0) corners[count++] = face[i];
    }
    if (count == 1)
      return {normals[static_cast<std::size_t>(corners[0])], is_border[static_cast<std::size_t>(corners[0])]};
    if (count == 3) return {unit_normal(mesh, face), false};
    const Edge& edge = edges.at(edge_key(corners[0], corners[1]));
    return {edge.normal, edge.surplus != 0};
  }

  double at(const Point& point) const {
    const SurfacePlace place = index.nearest(point);
    const Point to = point - place.point;
    const double distance = to.norm();
    const Feature feature = feature_at(place);
    return dot(to, feature.normal) >= 0 || feature.is_border ? distance : -distance;
  }
};

MeshDistance::MeshDistance(const TriangleMesh& mesh, double thickness) {
  HSI4D_CHECK(!mesh.faces.empty(), "the mesh has no faces");
  for (TriangleMesh& solid : solids_of(mesh)) {
    pieces_.push_back(std::make_unique<const Piece>(std::move(solid), thickness));
    if (pieces_.back()->is_open) thickest_slab_ = thickness;
  }
}

MeshDistance::~MeshDistance() = default;

double MeshDistance::at(const Vector3<double>& point) const {
  double least = kInfinity, unknown = kInfinity;
  for (const auto& piece : pieces_) {
    // What is farther from its box than the least so far is not in it, and nearer to another.
    if (!piece->is_outside_solid && piece->box.distance(point) > std::max(least, 0.0)) continue;
    const double distance = piece->at(point);
    if (piece->is_open && distance < -piece->thickness) {
      unknown = std::min(unknown, -distance);
    } else {
      least = std::min(least, distance);
    }
  }
  return least < 0 || least <= unknown ? least : std::numeric_limits<double>::quiet_NaN();
}

std::shared_ptr<const MeshDistance> read_mesh_distance(const std::string& path, double thickness) {
  const TriangleMesh mesh = read_mesh(path);
  const MeshEdges edges = count_edges(mesh);
  if (edges.open > 0) {
    log_warning(
        path + ": " + std::to_string(edges.open) + " of the mesh's " + std::to_string(edges.edges) +
        " edges are not between two triangles that agree on their side: the mesh is not closed. Its open pieces " +
        "count as solid only near their backs");
  } else if (signed_volume(mesh) < 0) {
    log_info(path + ": the mesh is turned inwards, as a room is: what lies outside of it counts as solid");
  }
  return std::make_shared<const MeshDistance>(mesh, thickness);
}

}  // namespace hsi4d
