#include "body/surface_index.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <nanoflann.hpp>
#include <utility>

namespace hsi4d {

namespace {

using Vector = Vector3<double>;
using Corners = std::array<Vector, 3>;

double squared_length(const Vector& v) { return dot(v, v); }

/// The share of b at the nearest place of the edge from a to b.
double nearest_on_edge(const Vector& a, const Vector& b, const Vector& point) {
  const Vector edge = b - a;
  const double squared = squared_length(edge);
  return squared > 0 ? std::clamp(dot(Vector(point - a), edge) / squared, 0.0, 1.0) : 0;
}

/// Barycentric shares of the foot of a point in a triangle's plane; false where it has none, or lies outside.
bool foot_inside(const Corners& c, const Vector& point, std::array<double, 3>& shares) {
  const Vector normal = cross(Vector(c[1] - c[0]), Vector(c[2] - c[0]));
  const double squared = squared_length(normal);
  if (!(squared > 0)) return false;
  for (std::size_t i = 0; i < 2; ++i) {
    const Vector from = c[(i + 1) % 3], edge = c[(i + 2) % 3] - from;
    shares[i] = dot(cross(edge, Vector(point - from)), normal) / squared;
    if (!(shares[i] >= 0 && shares[i] <= 1)) return false;
  }
  shares[2] = 1 - shares[0] - shares[1];
  return shares[2] >= 0;
}

Vector point_at(const Corners& c, const std::array<double, 3>& shares) {
  return c[0] * shares[0] + c[1] * shares[1] + c[2] * shares[2];
}

}  // namespace

SurfacePlace nearest_on_triangle(const Corners& corners, const Vector& point) {
  SurfacePlace best;
  if (foot_inside(corners, point, best.shares)) {
    best.point = point_at(corners, best.shares);
    return best;
  }
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t next = (i + 1) % 3;
    const double share = nearest_on_edge(corners[i], corners[next], point);
    SurfacePlace place;
    place.shares = {0, 0, 0};
    place.shares[i] = 1 - share;
    place.shares[next] = share;
    place.point = point_at(corners, place.shares);
    const double squared = squared_length(place.point - point);
    if (squared < nearest) nearest = squared, best = place;
  }
  return best;
}

Corners face_corners(const BodyModel& body, std::int32_t face) {
  Corners corners;
  for (std::size_t i = 0; i < 3; ++i) {
    const float* x = body.vertices.data() + 3 * Index{body.faces[3 * static_cast<std::size_t>(face) + i]};
    corners[i] = Vector(static_cast<double>(x[0]), static_cast<double>(x[1]), static_cast<double>(x[2]));
  }
  return corners;
}

std::vector<Vector> vertex_normals(const BodyModel& body) {
  std::vector<Vector> normals(static_cast<std::size_t>(body.vertex_count()), Vector::Zero());
  for (std::int32_t face = 0; face < body.face_count(); ++face) {
    const Corners c = face_corners(body, face);
    const Vector area = cross(Vector(c[1] - c[0]), Vector(c[2] - c[0]));
    for (std::size_t i = 0; i < 3; ++i)
      normals[static_cast<std::size_t>(body.faces[3 * static_cast<std::size_t>(face) + i])] += area;
  }
  for (Vector& normal : normals) normal = direction_of(normal).unit;
  return normals;
}

// --- the nearest of all ----------------------------------------------------------------------------------------------

namespace {

/// Faces whose corners are at most `radius` from their centroids.
struct Points {
  std::vector<std::array<double, 3>> centroids;
  std::vector<std::int32_t> faces;
  double radius = 0;

  // What nanoflann asks for.
  std::size_t kdtree_get_point_count() const { return centroids.size(); }
  double kdtree_get_pt(std::size_t i, std::size_t axis) const { return centroids[i][axis]; }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};

using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, Points>, Points, 3, std::size_t>;

/// Takes centroids from a tree's search, which goes on where their triangles can still be nearest.
class Nearest {
 public:
  using DistanceType = double;
  using IndexType = std::size_t;

  Nearest(const BodyModel& body, const Vector& point) : body_(body), point_(point) {}

  void search(const Points& points, const Tree& tree) {
    points_ = &points;
    tree.findNeighbors(*this, point_.data(), nanoflann::SearchParams(0, 0, false));
  }
  const SurfacePlace& place() const { return place_; }

  // What nanoflann asks for. Distances are squared.
  std::size_t size() const { return 1; }
  bool full() const { return true; }
  double worstDist() const {
    const double reach = distance_ + points_->radius;
    return reach * reach * (1 + 1e-12);
  }
  bool addPoint(double, std::size_t index) {
    const std::int32_t face = points_->faces[index];
    SurfacePlace place = nearest_on_triangle(face_corners(body_, face), point_);
    const double distance = std::sqrt(squared_length(place.point - point_));
    if (distance > distance_ || (distance == distance_ && face > place_.face)) return true;
    distance_ = distance;
    place_ = place;
    place_.face = face;
    return true;
  }

 private:
  const BodyModel& body_;
  const Vector point_;
  const Points* points_ = nullptr;
  SurfacePlace place_;
  double distance_ = std::numeric_limits<double>::infinity();
};

}  // namespace

struct SurfaceIndex::Trees {
  std::vector<std::unique_ptr<Points>> points;
  std::vector<std::unique_ptr<Tree>> trees;
};

SurfaceIndex::SurfaceIndex(const BodyModel& body) : body_(body) {
  HSI4D_CHECK(body.face_count() > 0, "the body has no surface");
  std::map<int, Points> by_size;  // by the exponent of the radius
  for (std::int32_t face = 0; face < body.face_count(); ++face) {
    const Corners c = face_corners(body, face);
    const Vector centroid = (c[0] + c[1] + c[2]) / 3.0;
    double radius = 0;
    for (const Vector& corner : c) radius = std::max(radius, std::sqrt(squared_length(corner - centroid)));
    Points& points = by_size[std::max(std::ilogb(radius + 1e-9), -20)];
    points.centroids.push_back({centroid[0], centroid[1], centroid[2]});
    points.faces.push_back(face);
    points.radius = std::max(points.radius, radius);
  }
  auto trees = std::make_unique<Trees>();
  for (auto& [size, points] : by_size) {
    trees->points.push_back(std::make_unique<Points>(std::move(points)));
    trees->trees.push_back(std::make_unique<Tree>(3, *trees->points.back()));
  }
  trees_ = std::move(trees);
}

SurfaceIndex::~SurfaceIndex() = default;

SurfacePlace SurfaceIndex::nearest(const Vector& point) const {
  HSI4D_CHECK(std::isfinite(point[0] + point[1] + point[2]), "the point is not finite");
  Nearest nearest(body_, point);
  for (std::size_t i = 0; i < trees_->trees.size(); ++i) nearest.search(*trees_->points[i], *trees_->trees[i]);
  return nearest.place();
}

// --- weights ---------------------------------------------------------------------------------------------------------

void append_weights(const BodyModel& body, const SurfacePlace& place, SparseWeights& weights) {
  std::array<std::pair<double, std::int32_t>, 3 * kMaxWeightsPerVertex> all;
  std::size_t count = 0;
  const Index k = body.weights.per_vertex;
  for (std::size_t corner = 0; corner < 3; ++corner) {
    const Index v = body.faces[3 * static_cast<std::size_t>(place.face) + corner];
    for (Index i = v * k; i < (v + 1) * k; ++i) {
      const auto at = static_cast<std::size_t>(i);
      const std::int32_t joint = body.weights.indices[at];
      const auto end = all.begin() + static_cast<std::ptrdiff_t>(count);
      const auto found = std::find_if(all.begin(), end, [&](const auto& entry) { return entry.second == joint; });
      const double weight = place.shares[corner] * body.weights.weights[at];
      if (found != end) {
        found->first += weight;
      } else {
        all[count++] = {weight, joint};
      }
    }
  }
  std::sort(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(count),
            [](const auto& a, const auto& b) { return a.first != b.first ? a.first > b.first : a.second < b.second; });
  const std::size_t kept = std::min(count, static_cast<std::size_t>(weights.per_vertex));
  double sum = 0;
  for (std::size_t i = 0; i < kept; ++i) sum += all[i].first;
  for (std::size_t i = 0; i < static_cast<std::size_t>(weights.per_vertex); ++i) {
    weights.indices.push_back(i < kept ? all[i].second : all[0].second);
    weights.weights.push_back(i < kept ? all[i].first / sum : 0.0);
  }
}

}  // namespace hsi4d
