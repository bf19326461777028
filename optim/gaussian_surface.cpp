#include "optim/gaussian_surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <nanoflann.hpp>
#include <numeric>

#include "core/check.h"
#include "core/parallel.h"
#include "core/quaternion.h"

namespace hsi4d {

namespace {

using Point = Vector3<double>;

constexpr double kOpaque = 0.5, kFlat = 0.5;
constexpr std::size_t kNeighbours = 8;
/// A disc reaches so many widths from its centre; so far it hides what is behind, and is solid behind itself.
constexpr double kReach = 2;

/// Edge of the cells in which discs that may hide others are looked for, metres.
constexpr double kCell = 0.05;
/// Cells along an axis at most; the scene's far parts are then hidden by nothing.
constexpr std::int64_t kMostCells = 256;
constexpr Index kGrain = 256;

/// Discs, as nanoflann reads them.
struct Centers {
  std::vector<SurfaceDisc> discs;
  std::size_t kdtree_get_point_count() const { return discs.size(); }
  double kdtree_get_pt(std::size_t i, std::size_t axis) const {
    return discs[i].center[static_cast<Eigen::Index>(axis)];
  }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};

using KdTree =
    nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, Centers>, Centers, 3, std::uint32_t>;

/// Discs whose planes are nearer to each other than this are of one surface, with its noise, metres.
constexpr double kOneSurface = 0.015;

/// Whether a ray from a point meets a disc of another surface within `farthest` metres.
bool meets(const SurfaceDisc& disc, const Point& from, const Point& direction, double farthest) {
  const double across = dot(disc.normal, direction), offset = dot(disc.normal, Point(disc.center - from));
  if (std::fabs(across) < 1e-3 || std::fabs(offset) < kOneSurface) return false;
  const double along = offset / across;
  if (!(along > 0 && along < farthest)) return false;
  return (from + along * direction - disc.center).norm() < kReach * disc.width;
}

/// Discs by the cells of space that their centres are in, around the viewpoints.
class DiscCells {
 public:
  DiscCells(const std::vector<SurfaceDisc>& discs, const std::vector<Point>& viewpoints) : discs_(discs) {
    set_bounds(viewpoints);
    std::vector<std::int64_t> cells;
    begins_.resize(static_cast<std::size_t>(count_[0] * count_[1] * count_[2]) + 1, 0);
    for (const SurfaceDisc& disc : discs) {
      cells.push_back(cell_of(disc.center));
      if (cells.back() >= 0) ++begins_[static_cast<std::size_t>(cells.back()) + 1];
    }
    std::partial_sum(begins_.begin(), begins_.end(), begins_.begin());
    order_.resize(begins_.back());
    std::vector<std::uint32_t> next(begins_.begin(), begins_.end() - 1);
    for (std::size_t i = 0; i < discs.size(); ++i) {
      if (cells[i] >= 0) order_[next[static_cast<std::size_t>(cells[i])]++] = static_cast<std::uint32_t>(i);
    }
  }

  /// Whether a disc of another surface is between two points, by the cells on the way.
  bool is_hidden(const Point& from, const Point& to) const {
    const auto way = direction_of(Point(to - from));
    const auto steps = static_cast<std::int64_t>(way.length / (0.5 * kCell)) + 1;
    std::int64_t last = -1;
    for (std::int64_t i = 0; i < steps; ++i) {
      const std::int64_t cell = cell_of(from + way.unit * (0.5 * kCell * static_cast<double>(i)));
      if (cell < 0 || cell == last) continue;
      last = cell;
      for (std::uint32_t k = begins_[static_cast<std::size_t>(cell)]; k < begins_[static_cast<std::size_t>(cell) + 1];
           ++k) {
        if (meets(discs_[order_[k]], from, way.unit, way.length)) return true;
      }
    }
    return false;
  }

 private:
  void set_bounds(const std::vector<Point>& viewpoints) {
    const double half = 0.5 * static_cast<double>(kMostCells) * kCell;
    Point middle = Point::Zero();
    for (const Point& p : viewpoints) middle += p / static_cast<double>(viewpoints.size());
    Point low = Point::Constant(std::numeric_limits<double>::infinity()), high = -low;
    for (const SurfaceDisc& disc : discs_) {
      low = low.cwiseMin(disc.center);
      high = high.cwiseMax(disc.center);
    }
    low_ = low.cwiseMax(middle - Point::Constant(half));
    high = high.cwiseMin(middle + Point::Constant(half));
    for (int i = 0; i < 3; ++i)
      count_[static_cast<std::size_t>(i)] =
          std::max<std::int64_t>(1, static_cast<std::int64_t>((high[i] - low_[i]) / kCell) + 1);
  }

  std::int64_t cell_of(const Point& p) const {
    std::int64_t at = 0;
    for (int i = 0; i < 3; ++i) {
      const auto count = count_[static_cast<std::size_t>(i)];
      const double x = std::floor((p[i] - low_[i]) / kCell);
      if (!(x >= 0 && x < static_cast<double>(count))) return -1;
      at = at * count + static_cast<std::int64_t>(x);
    }
    return at;
  }

  const std::vector<SurfaceDisc>& discs_;
  Point low_;
  std::array<std::int64_t, 3> count_{};
  std::vector<std::uint32_t> begins_, order_;  // of each cell, in order_; rows of discs
};

Point point_at(const std::vector<float>& numbers, Index row) {
  return Vector3<float>(numbers.data() + 3 * row).cast<double>();
}

}  // namespace

std::vector<SurfaceDisc> surface_discs(const Gaussians& gaussians) {
  std::vector<SurfaceDisc> discs;
  const float opaque_logit = static_cast<float>(std::log(kOpaque / (1 - kOpaque)));
  for (Index g = 0; g < gaussians.count(); ++g) {
    if (!(gaussians.opacity_logits[static_cast<std::size_t>(g)] >= opaque_logit)) continue;
    const Point log_scales = point_at(gaussians.log_scales, g);
    Eigen::Index shortest = 0, longest = 0;
    log_scales.minCoeff(&shortest);
    log_scales.maxCoeff(&longest);
    if (shortest == longest) continue;
    const double middle = log_scales[3 - shortest - longest];
    if (!(log_scales[shortest] <= middle + std::log(kFlat))) continue;
    const Vector4<double> q = Vector4<float>(gaussians.quats.data() + 4 * g).cast<double>();
    const Point normal = detail::unit_quaternion_to_matrix(direction_of(q).unit).col(shortest);
    discs.push_back({gaussians.origin_world + point_at(gaussians.means, g), normal, std::exp(log_scales[longest])});
  }
  return discs;
}

std::vector<SurfaceDisc> facing(const std::vector<SurfaceDisc>& discs, const std::vector<Vector3<double>>& viewpoints) {
  if (discs.empty() || viewpoints.empty()) return {};
  const DiscCells cells(discs, viewpoints);
  std::vector<int> sides(discs.size(), 0);
  parallel_for(std::ssize(discs), kGrain, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      const SurfaceDisc& disc = discs[static_cast<std::size_t>(i)];
      for (const Point& viewpoint : viewpoints) {
        const auto way = direction_of(Point(viewpoint - disc.center));
        const double side = dot(way.unit, disc.normal);
        if (std::fabs(side) < 0.05) continue;  // along the surface: seen by nobody
        if (cells.is_hidden(disc.center, viewpoint)) continue;
        sides[static_cast<std::size_t>(i)] = side > 0 ? 1 : -1;
        break;
      }
    }
  });
  std::vector<SurfaceDisc> turned;
  for (std::size_t i = 0; i < discs.size(); ++i) {
    if (sides[i] == 0) continue;
    turned.push_back(discs[i]);
    turned.back().normal *= sides[i];
  }
  return turned;
}

struct GaussianDistance::Tree {
  Centers centers;
  KdTree tree;
  explicit Tree(std::vector<SurfaceDisc> discs) : centers{std::move(discs)}, tree(3, centers) {}
};

GaussianDistance::GaussianDistance(std::vector<SurfaceDisc> discs, double thickness) : thickness_(thickness) {
  HSI4D_CHECK(!discs.empty(), "there is no surface");
  tree_ = std::make_unique<const Tree>(std::move(discs));
}

GaussianDistance::~GaussianDistance() = default;

double GaussianDistance::at(const Vector3<double>& point) const {
  std::array<std::uint32_t, kNeighbours> near;
  std::array<double, kNeighbours> squared;
  const std::size_t found = tree_->tree.knnSearch(point.data(), kNeighbours, near.data(), squared.data());
  const std::vector<SurfaceDisc>& discs = tree_->centers.discs;
  const SurfaceDisc& nearest = discs[near[0]];
  const double spread = 2 * nearest.width * nearest.width;
  double sum = 0, weights = 0;
  for (std::size_t k = 0; k < found; ++k) {
    const SurfaceDisc& disc = discs[near[k]];
    if (dot(disc.normal, nearest.normal) < 0) continue;
    const double weight = std::exp(-(squared[k] - squared[0]) / spread);
    sum += weight * dot(disc.normal, Point(point - disc.center));
    weights += weight;
  }
  const double distance = sum / weights;
  if (distance >= 0) return distance;
  const Point from = point - nearest.center;
  const double beside = (from - nearest.normal * dot(nearest.normal, from)).norm();
  const bool is_known = distance >= -thickness_ && beside <= kReach * nearest.width;
  return is_known ? distance : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace hsi4d
