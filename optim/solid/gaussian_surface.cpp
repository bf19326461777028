#include "optim/solid/gaussian_surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <nanoflann.hpp>
#include <numeric>

#include "core/check.h"
#include "core/parallel.h"
#include "core/quaternion.h"
#include "core/random.h"

namespace hsi4d {

namespace {

using Point = Vector3<double>;
using Cell = Eigen::Array<std::int64_t, 3, 1>;

constexpr double kOpaque = 0.5, kFlat = 0.5;
constexpr std::size_t kNeighbours = 8;
/// A disc reaches so many widths from its centre; so far it hides what is behind, and is solid behind itself.
constexpr double kReach = 2;

/// Edge of the smallest cells in which discs that may hide others are looked for, metres; others are twice as large,
/// four times and so on.
constexpr double kCell = 0.05;
constexpr int kLevels = 8;
/// Of the smallest cells along an axis at most; the scene's far parts then hide nothing.
constexpr double kMostCells = 256;
constexpr Index kDiscGrain = 256;
/// Discs that one has to have about it, not to float.
constexpr std::size_t kSupport = 2;
constexpr std::uint64_t kThinning = 1;  // seed

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

/// Whether a place of a disc's plane is within its reach.
bool reaches(const SurfaceDisc& disc, const Point& place) {
  const Point from = place - disc.center;
  const double along = dot(from, disc.along) / disc.width,
               across = dot(from, Point(cross(disc.normal, disc.along))) / disc.narrow;
  return along * along + across * across <= kReach * kReach;
}

/// Whether a ray from a point meets a disc of another surface within `farthest` metres.
bool meets(const SurfaceDisc& disc, const Point& from, const Point& direction, double farthest) {
  const double across = dot(disc.normal, direction), offset = dot(disc.normal, Point(disc.center - from));
  if (std::fabs(across) < 1e-3 || std::fabs(offset) < kOneSurface) return false;
  const double along = offset / across;
  return along > 0 && along < farthest && reaches(disc, from + along * direction);
}

/// Half the edges of a disc's box.
Point extent_of(const SurfaceDisc& disc) {
  const Point side = cross(disc.normal, disc.along);
  Point extent;
  for (int i = 0; i < 3; ++i) extent[i] = kReach * std::hypot(disc.width * disc.along[i], disc.narrow * side[i]);
  return extent;
}

/// A box in space.
struct Box {
  Point low, high;
};

/// Cells of one size, and in each the discs whose boxes reach into it.
class DiscGrid {
 public:
  /// @param rows  of the discs that are put in
  DiscGrid(const std::vector<SurfaceDisc>& discs, const std::vector<std::uint32_t>& rows, const Box& box, double edge)
      : discs_(discs), low_(box.low), edge_(edge) {
    for (int i = 0; i < 3; ++i) count_[i] = static_cast<std::int64_t>((box.high[i] - low_[i]) / edge_) + 1;
    begins_.resize(static_cast<std::size_t>(count_[0] * count_[1] * count_[2]) + 1, 0);
    for (const std::uint32_t row : rows) for_cells_of(discs[row], [this](std::size_t cell) { ++begins_[cell + 1]; });
    std::partial_sum(begins_.begin(), begins_.end(), begins_.begin());
    order_.resize(begins_.back());
    std::vector<std::uint32_t> next(begins_.begin(), begins_.end() - 1);
    for (const std::uint32_t row : rows)
      for_cells_of(discs[row], [&](std::size_t cell) { order_[next[cell]++] = row; });
  }

  /// Whether a disc of another surface is met on the way, by the cells that it passes.  [Amanatides and Woo 1987]
  bool is_met(const Point& from, const Point& direction, double length) const {
    double begin = 0, end = length;
    for (int i = 0; i < 3; ++i) {
      if (direction[i] == 0) {
        if (cell_along(from, i) < 0 || cell_along(from, i) >= count_[i]) return false;
        continue;
      }
      const double low = wall(i, 0, from, direction), high = wall(i, count_[i], from, direction);
      begin = std::max(begin, std::min(low, high));
      end = std::min(end, std::max(low, high));
    }
    if (!(begin <= end)) return false;
    Cell at;
    for (int i = 0; i < 3; ++i)
      at[i] = std::clamp<std::int64_t>(cell_along(from + begin * direction, i), 0, count_[i] - 1);
    while (true) {
      if (is_met_in(number_of(at), from, direction, length)) return true;
      int axis = 0;
      double least = std::numeric_limits<double>::infinity();
      for (int i = 0; i < 3; ++i) {
        if (direction[i] == 0) continue;
        const double next = wall(i, at[i] + (direction[i] > 0 ? 1 : 0), from, direction);
        if (next >= least) continue;
        least = next;
        axis = i;
      }
      at[axis] += direction[axis] > 0 ? 1 : -1;
      if (!(least < end) || at[axis] < 0 || at[axis] >= count_[axis]) return false;
    }
  }

 private:
  std::int64_t cell_along(const Point& p, int axis) const {
    const double cell = std::floor((p[axis] - low_[axis]) / edge_);
    return static_cast<std::int64_t>(std::clamp(cell, -1.0, static_cast<double>(count_[axis])));
  }

  /// How far along a ray the wall before cell `number` of an axis is, metres.
  double wall(int axis, std::int64_t number, const Point& from, const Point& direction) const {
    return (low_[axis] + edge_ * static_cast<double>(number) - from[axis]) / direction[axis];
  }

  std::size_t number_of(const Cell& at) const {
    return static_cast<std::size_t>((at[0] * count_[1] + at[1]) * count_[2] + at[2]);
  }

  bool is_met_in(std::size_t cell, const Point& from, const Point& direction, double length) const {
    for (std::uint32_t k = begins_[cell]; k < begins_[cell + 1]; ++k) {
      if (meets(discs_[order_[k]], from, direction, length)) return true;
    }
    return false;
  }

  template <class F>
  void for_cells_of(const SurfaceDisc& disc, const F& act) const {
    const Point extent = extent_of(disc), low = disc.center - extent, high = disc.center + extent;
    Cell first, last, at;
    for (int i = 0; i < 3; ++i) {
      first[i] = std::max<std::int64_t>(cell_along(low, i), 0);
      last[i] = std::min<std::int64_t>(cell_along(high, i), count_[i] - 1);
    }
    for (at[0] = first[0]; at[0] <= last[0]; ++at[0]) {
      for (at[1] = first[1]; at[1] <= last[1]; ++at[1]) {
        for (at[2] = first[2]; at[2] <= last[2]; ++at[2]) act(number_of(at));
      }
    }
  }

  const std::vector<SurfaceDisc>& discs_;
  Point low_;
  double edge_;
  Cell count_;
  std::vector<std::uint32_t> begins_, order_;  // of each cell, in order_; rows of discs
};

/// Discs by the cells of space that they reach into, each among cells of its own size.
class DiscCells {
 public:
  DiscCells(const std::vector<SurfaceDisc>& discs, const std::vector<Point>& viewpoints) {
    const Box box = box_of(discs, viewpoints);
    std::array<std::vector<std::uint32_t>, kLevels> rows;
    for (std::size_t i = 0; i < discs.size(); ++i) {
      const Point extent = extent_of(discs[i]);
      if (((discs[i].center + extent).array() < box.low.array()).any() ||
          ((discs[i].center - extent).array() > box.high.array()).any())
        continue;
      const double edge = 2 * extent.maxCoeff();
      std::size_t level = 0;
      while (level + 1 < kLevels && kCell * static_cast<double>(1U << level) < edge) ++level;
      rows[level].push_back(static_cast<std::uint32_t>(i));
    }
    for (std::size_t level = 0; level < kLevels; ++level) {
      if (!rows[level].empty()) grids_.emplace_back(discs, rows[level], box, kCell * static_cast<double>(1U << level));
    }
  }

  /// Whether a disc of another surface is between two points.
  bool is_hidden(const Point& from, const Point& to) const {
    const auto way = direction_of(Point(to - from));
    return std::any_of(grids_.begin(), grids_.end(),
                       [&](const DiscGrid& grid) { return grid.is_met(from, way.unit, way.length); });
  }

 private:
  /// All discs; where that is too large for the smallest cells, the part about the viewpoints' middle.
  static Box box_of(const std::vector<SurfaceDisc>& discs, const std::vector<Point>& viewpoints) {
    Box box{Point::Constant(std::numeric_limits<double>::infinity()),
            Point::Constant(-std::numeric_limits<double>::infinity())};
    for (const SurfaceDisc& disc : discs) {
      const Point extent = extent_of(disc);
      box.low = box.low.cwiseMin(disc.center - extent);
      box.high = box.high.cwiseMax(disc.center + extent);
    }
    if ((box.high - box.low).maxCoeff() <= kMostCells * kCell) return box;
    Point middle = Point::Zero();
    for (const Point& p : viewpoints) middle += p / static_cast<double>(viewpoints.size());
    const Point half = Point::Constant(0.5 * kMostCells * kCell);
    box.low = box.low.cwiseMax(middle - half).cwiseMin(middle + half);
    box.high = box.high.cwiseMin(middle + half).cwiseMax(box.low);
    return box;
  }

  std::vector<DiscGrid> grids_;
};

/// Which side of a disc is seen from a viewpoint: 1 that of its normal, −1 the other one, 0 none.
int seen_side(const SurfaceDisc& disc, const Point& viewpoint, const DiscCells& cells) {
  const auto way = direction_of(Point(viewpoint - disc.center));
  const double side = dot(way.unit, disc.normal);
  if (std::fabs(side) < 0.05 || cells.is_hidden(disc.center, viewpoint)) return 0;  // along the surface: by nobody
  return side > 0 ? 1 : -1;
}

/// Discs turned to the sides that `side_of` says; 0: left out.
template <class F>
std::vector<SurfaceDisc> turned(const std::vector<SurfaceDisc>& discs, const F& side_of) {
  std::vector<int> sides(discs.size(), 0);
  parallel_for(std::ssize(discs), kDiscGrain, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      const auto row = static_cast<std::size_t>(i);
      sides[row] = side_of(discs[row]);
    }
  });
  std::vector<SurfaceDisc> known;
  for (std::size_t i = 0; i < discs.size(); ++i) {
    if (sides[i] == 0) continue;
    known.push_back(discs[i]);
    if (sides[i] < 0) known.back().normal = -known.back().normal;
  }
  return known;
}

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
    const Matrix3<double> axes = detail::unit_quaternion_to_matrix(direction_of(q).unit);
    discs.push_back({gaussians.origin_world + point_at(gaussians.means, g), axes.col(shortest),
                     std::exp(log_scales[longest]), axes.col(longest), std::exp(middle)});
  }
  return discs;
}

std::vector<SurfaceDisc> without_floaters(const std::vector<SurfaceDisc>& discs) {
  const Centers centers{discs};
  const KdTree tree(3, centers);
  std::vector<std::uint8_t> stays(discs.size(), 0);
  parallel_for(std::ssize(discs), kDiscGrain, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      const SurfaceDisc& disc = discs[static_cast<std::size_t>(i)];
      std::array<std::uint32_t, kSupport + 1> near{};  // itself too
      std::array<double, kSupport + 1> squared{};
      const std::size_t found = tree.knnSearch(disc.center.data(), near.size(), near.data(), squared.data());
      const double reach = kReach * disc.width;
      stays[static_cast<std::size_t>(i)] = found == near.size() && squared.back() <= reach * reach ? 1 : 0;
    }
  });
  std::vector<SurfaceDisc> left;
  for (std::size_t i = 0; i < discs.size(); ++i) {
    if (stays[i] == 1) left.push_back(discs[i]);
  }
  return left;
}

std::vector<SurfaceDisc> thinned(const std::vector<SurfaceDisc>& discs, std::size_t most) {
  if (discs.size() <= most) return discs;
  const double wider = std::sqrt(static_cast<double>(discs.size()) / static_cast<double>(most));
  std::vector<Index> rows = Random(kThinning, 0).permutation(0, std::ssize(discs));
  rows.resize(most);
  std::sort(rows.begin(), rows.end());
  std::vector<SurfaceDisc> chosen;
  for (const Index row : rows) {
    chosen.push_back(discs[static_cast<std::size_t>(row)]);
    chosen.back().width *= wider;
    chosen.back().narrow *= wider;
  }
  return chosen;
}

std::vector<SurfaceDisc> facing(const std::vector<SurfaceDisc>& discs, const std::vector<Point>& viewpoints) {
  if (discs.empty() || viewpoints.empty()) return {};
  const DiscCells cells(discs, viewpoints);
  return turned(discs, [&](const SurfaceDisc& disc) {
    for (const Point& viewpoint : viewpoints) {
      if (const int side = seen_side(disc, viewpoint, cells); side != 0) return side;
    }
    return 0;
  });
}

std::vector<SurfaceDisc> facing_most(const std::vector<SurfaceDisc>& discs, const std::vector<Point>& viewpoints) {
  if (discs.empty() || viewpoints.empty()) return {};
  const DiscCells cells(discs, viewpoints);
  return turned(discs, [&](const SurfaceDisc& disc) {
    int votes = 0;
    for (const Point& viewpoint : viewpoints) votes += seen_side(disc, viewpoint, cells);
    return votes;
  });
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
  const bool is_known = distance >= -thickness_ && reaches(nearest, point);
  return is_known ? distance : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace hsi4d
