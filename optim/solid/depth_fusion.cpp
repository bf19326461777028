#include "optim/solid/depth_fusion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <utility>

#include "core/check.h"
#include "core/parallel.h"
#include "core/text.h"

namespace hsi4d {

namespace {

constexpr float kEndless = std::numeric_limits<float>::infinity();
constexpr double kNear = 1e-3;        // metres: boxes that reach nearer to a camera are looked at node by node
constexpr std::int32_t kCoarse = 4;   // blocks along a side of what is looked at first
constexpr double kLeastSlant = 0.25;  // flatter ones count as this
constexpr double kMostSlope = 2;      // truncations between four pixels that are still one surface

/// The smallest and the largest number of squares of pixels, each level of half the size of the one below.
struct Range {
  float low = kEndless, high = 0;
  void add(const Range& other) {
    low = std::min(low, other.low);
    high = std::max(high, other.high);
  }
};

/// Pixels [left, right) × [top, bottom).
struct PixelBox {
  Index left, top, right, bottom;
};

/// Sums over the views, of the nodes of a block.
struct NodeSums {
  std::array<double, kSolidBlockNodes> said{};  ///< metres
  std::array<double, kSolidBlockNodes> weight{};
};

/// A view made ready for many questions.
class SeenDepths {
 public:
  SeenDepths(const DepthView& view, double truncation) : camera_(view.camera), truncation_(truncation) {
    const std::size_t pixels = static_cast<std::size_t>(camera_.width) * static_cast<std::size_t>(camera_.height);
    HSI4D_CHECK_EQ(view.depths.size(), pixels);
    depths_.resize(pixels);
    std::vector<Range> ranges(pixels);
    for (std::size_t i = 0; i < pixels; ++i) {
      depths_[i] = view.depths[i] > 0 ? view.depths[i] : kEndless;
      ranges[i] = {depths_[i], depths_[i]};
    }
    slants_.resize(pixels);
    for (Index y = 0; y < camera_.height; ++y) {
      for (Index x = 0; x < camera_.width; ++x)
        slants_[static_cast<std::size_t>(y * camera_.width + x)] = slant_at(x, y);
    }
    levels_.push_back({camera_.width, camera_.height, std::move(ranges)});
    while (levels_.back().width > 1 || levels_.back().height > 1) levels_.push_back(halved(levels_.back()));
  }

  enum class Says { kNothing, kFree, kPartly };

  /// What the view says of all nodes in a box.
  Says of_box(const Vector3<double>& low, const Vector3<double>& high) const {
    double z_low = std::numeric_limits<double>::infinity(), z_high = -z_low;
    double left = z_low, right = -z_low, top = z_low, bottom = -z_low;
    for (int corner = 0; corner < 8; ++corner) {
      const Vector3<double> at((corner & 1) != 0 ? high[0] : low[0], (corner & 2) != 0 ? high[1] : low[1],
                               (corner & 4) != 0 ? high[2] : low[2]);
      const Vector3<double> p = transform_point(camera_.camera_from_world, at);
      z_low = std::min(z_low, p[2]);
      z_high = std::max(z_high, p[2]);
      const Vector2<double> pixel = project_point(camera_, Vector3<double>(p[0], p[1], std::max(p[2], kNear)));
      left = std::min(left, pixel[0]);
      right = std::max(right, pixel[0]);
      top = std::min(top, pixel[1]);
      bottom = std::max(bottom, pixel[1]);
    }
    if (z_high <= kNear) return Says::kNothing;
    if (z_low <= kNear) return Says::kPartly;
    if (right <= 0 || bottom <= 0 || left >= camera_.width || top >= camera_.height) return Says::kNothing;
    const bool is_inside = left >= 0 && top >= 0 && right < camera_.width && bottom < camera_.height;
    const Range range = range_of(pixel_box(left, top, right, bottom));
    const double most = truncation_ / kLeastSlant;  // along z
    if (z_low > static_cast<double>(range.high) + most) return Says::kNothing;
    if (is_inside && z_high + most <= static_cast<double>(range.low)) return Says::kFree;
    return Says::kPartly;
  }

  /// Adds what the view says of the nodes of a block: how far each lies before what is seen, at most the truncation.
  void add_to(const SolidGrid& grid, const NodePlace& block, NodeSums& sums) const {
    const Vector3<double> step = grid.voxel * camera_.camera_from_world.rotation.col(2);
    std::size_t n = 0;
    for (std::int32_t i = 0; i < kSolidBlock; ++i) {
      for (std::int32_t j = 0; j < kSolidBlock; ++j) {
        const NodePlace first = {kSolidBlock * block[0] + i, kSolidBlock * block[1] + j, kSolidBlock * block[2]};
        const Vector3<double> start = transform_point(camera_.camera_from_world, grid.place_of_node(first));
        for (std::int32_t k = 0; k < kSolidBlock; ++k, ++n) add_point(start + k * step, n, sums);
      }
    }
  }

 private:
  /// @param p  in the camera's frame
  void add_point(const Vector3<double>& p, std::size_t n, NodeSums& sums) const {
    if (!(p[2] > kNear)) return;
    const Vector2<double> pixel = project_point(camera_, p);
    if (!(pixel[0] >= 0 && pixel[1] >= 0 && pixel[0] < camera_.width && pixel[1] < camera_.height)) return;
    const std::size_t own = static_cast<std::size_t>(pixel[1]) * static_cast<std::size_t>(camera_.width) +
                            static_cast<std::size_t>(pixel[0]);
    const double slant = static_cast<double>(slants_[own]), before = slant * (depth_at(pixel) - p[2]);
    if (before < -truncation_) return;
    const double weight = before >= truncation_ ? 1 : slant * slant;
    sums.said[n] += weight * std::min(before, truncation_);
    sums.weight[n] += weight;
  }

  /// How far from a surface a point is that lies 1 m before it along z: the cosine of the angle between the ray and the
  /// surface's normal, times the length of the ray for z = 1, held to [kLeastSlant, 1]. Of the neighbours the nearer
  /// ones are taken.
  float slant_at(Index x, Index y) const {
    const auto seen = [&](Index i, Index j) {
      const double depth = depth_of(std::clamp(i, Index{0}, Index{camera_.width} - 1),
                                    std::clamp(j, Index{0}, Index{camera_.height} - 1));
      return unproject_pixel(camera_, Vector2<double>(static_cast<double>(i) + 0.5, static_cast<double>(j) + 0.5),
                             depth);
    };
    const Vector3<double> own = seen(x, y);
    if (!std::isfinite(own[2])) return 1;
    const auto across = [&](Index i, Index j) {
      const Vector3<double> before = own - seen(x - i, y - j), behind = seen(x + i, y + j) - own;
      return std::abs(before[2]) < std::abs(behind[2]) ? before : behind;
    };
    const Vector3<double> normal = cross(across(1, 0), across(0, 1));
    const double slant = std::abs(normal.dot(Vector3<double>(own / own[2]))) / normal.norm();
    return std::isfinite(slant) ? static_cast<float>(std::clamp(slant, kLeastSlant, 1.0)) : 1.0F;
  }

  struct Level {
    Index width, height;
    std::vector<Range> ranges;
    const Range& at(Index x, Index y) const { return ranges[static_cast<std::size_t>(y * width + x)]; }
  };

  static Level halved(const Level& fine) {
    Level coarse{(fine.width + 1) / 2, (fine.height + 1) / 2, {}};
    coarse.ranges.resize(static_cast<std::size_t>(coarse.width * coarse.height));
    for (Index y = 0; y < fine.height; ++y) {
      for (Index x = 0; x < fine.width; ++x)
        coarse.ranges[static_cast<std::size_t>(y / 2 * coarse.width + x / 2)].add(fine.at(x, y));
    }
    return coarse;
  }

  /// With the neighbours that interpolation looks at.
  PixelBox pixel_box(double left, double top, double right, double bottom) const {
    const auto held = [](double at, Index size) {
      return static_cast<Index>(std::clamp(std::floor(at), 0.0, static_cast<double>(size - 1)));
    };
    return {held(left - 1, camera_.width), held(top - 1, camera_.height), held(right + 1, camera_.width) + 1,
            held(bottom + 1, camera_.height) + 1};
  }

  Range range_of(const PixelBox& box) const {
    std::size_t level = 0;
    const Index size = std::max(box.right - box.left, box.bottom - box.top);
    while ((Index{2} << level) < size && level + 1 < levels_.size()) ++level;
    Range range;
    const Level& of = levels_[level];
    for (Index y = box.top >> level; y <= (box.bottom - 1) >> level; ++y) {
      for (Index x = box.left >> level; x <= (box.right - 1) >> level; ++x) range.add(of.at(x, y));
    }
    return range;
  }

  /// Between pixel centres where four of them show one surface; else the nearest of them: beside an edge a pixel says
  /// nothing of what lies behind the edge.
  double depth_at(const Vector2<double>& pixel) const {
    const double u = pixel[0] - 0.5, v = pixel[1] - 0.5;
    const auto x = static_cast<Index>(std::floor(u)), y = static_cast<Index>(std::floor(v));
    if (x < 0 || y < 0 || x + 1 >= camera_.width || y + 1 >= camera_.height)
      return depth_of(static_cast<Index>(pixel[0]), static_cast<Index>(pixel[1]));
    const double a = depth_of(x, y), b = depth_of(x + 1, y), c = depth_of(x, y + 1), d = depth_of(x + 1, y + 1);
    const double low = std::min({a, b, c, d}), high = std::max({a, b, c, d});
    if (!(high - low <= kMostSlope * truncation_)) return low;
    const double s = u - static_cast<double>(x), t = v - static_cast<double>(y);
    return (1 - t) * ((1 - s) * a + s * b) + t * ((1 - s) * c + s * d);
  }

  double depth_of(Index x, Index y) const {
    return static_cast<double>(depths_[static_cast<std::size_t>(y * camera_.width + x)]);
  }

  Camera camera_;
  double truncation_;  // metres
  std::vector<float> depths_, slants_;
  std::vector<Level> levels_;
};

/// What all views say of a box: those that must be asked node by node, and how many say that all of it is free.
struct Verdict {
  std::vector<const SeenDepths*> partly;
  Index free = 0;
};

Verdict of_box(const std::vector<const SeenDepths*>& views, Index free, const Vector3<double>& low,
               const Vector3<double>& high) {
  Verdict verdict{{}, free};
  for (const SeenDepths* view : views) {
    const SeenDepths::Says says = view->of_box(low, high);
    if (says == SeenDepths::Says::kPartly) verdict.partly.push_back(view);
    if (says == SeenDepths::Says::kFree) ++verdict.free;
  }
  return verdict;
}

/// The values of one block, or which of the two kinds it all is.
struct FusedBlock {
  std::int32_t kind;
  SolidGrid::Values values;
};

FusedBlock fused_block(const SolidGrid& grid, const NodePlace& place, const Verdict& verdict) {
  FusedBlock result{SolidGrid::kSolid, {}};
  const double truncation = grid.truncation * grid.voxel;
  NodeSums sums;
  sums.said.fill(static_cast<double>(verdict.free) * truncation);
  sums.weight.fill(static_cast<double>(verdict.free));
  for (const SeenDepths* view : verdict.partly) view->add_to(grid, place, sums);
  const auto limit = static_cast<float>(grid.truncation);  // rounded, so that sums that round are all free or all solid
  bool some_free = false, some_solid = false;
  for (std::size_t n = 0; n < kSolidBlockNodes; ++n) {
    const double mean = sums.weight[n] == 0 ? -grid.truncation : sums.said[n] / sums.weight[n] / grid.voxel;
    result.values[n] = static_cast<float>(mean);
    some_free |= result.values[n] > -limit;
    some_solid |= result.values[n] < limit;
  }
  if (some_free) result.kind = some_solid ? 0 : SolidGrid::kFree;
  return result;
}

SolidGrid empty_grid(const FusionSettings& settings) {
  const Vector3<double> size = settings.high - settings.low;
  if (!(size.minCoeff() > 0) || !size.allFinite() || !(settings.voxel > 0))
    throw UserError("there is no box to look for surfaces in: its sides are " + number_text(size[0]) + ", " +
                    number_text(size[1]) + " and " + number_text(size[2]) + " m");
  SolidGrid grid;
  grid.voxel = settings.voxel;
  grid.truncation = settings.truncation;
  grid.is_outside_free = settings.is_outside_free;
  const double side = static_cast<double>(kSolidBlock) * settings.voxel;
  double count = 1;
  for (Index i = 0; i < 3; ++i) {
    const double along = std::ceil(size[i] / side) + 2;  // a block of the outside at each end
    count *= along;
    grid.blocks[static_cast<std::size_t>(i)] = static_cast<std::int32_t>(std::min(along, 1e9));
  }
  if (count > static_cast<double>(kMostSolidBlocks))
    throw UserError(
        "a voxel of " + number_text(settings.voxel) + " m is too small for a box of " + number_text(size[0]) + " x " +
        number_text(size[1]) + " x " + number_text(size[2]) + " m; allowed: " +
        number_text(settings.voxel * std::cbrt(count / static_cast<double>(kMostSolidBlocks))) + " m and more");
  grid.origin = settings.low - Vector3<double>::Constant(side);
  grid.block.assign(static_cast<std::size_t>(grid.block_count()),
                    grid.is_outside_free ? SolidGrid::kFree : SolidGrid::kSolid);
  return grid;
}

/// A cube of kCoarse³ blocks, or less at the grid's end; without the blocks at the ends, which are of the outside.
struct CoarseCube {
  NodePlace first, end;  ///< blocks
  std::vector<std::pair<Index, FusedBlock>> blocks;
};

std::vector<CoarseCube> coarse_cubes(const SolidGrid& grid) {
  std::vector<CoarseCube> cubes;
  for (std::int32_t i = 1; i + 1 < grid.blocks[0]; i += kCoarse) {
    for (std::int32_t j = 1; j + 1 < grid.blocks[1]; j += kCoarse) {
      for (std::int32_t k = 1; k + 1 < grid.blocks[2]; k += kCoarse)
        cubes.push_back({{i, j, k},
                         {std::min(i + kCoarse, grid.blocks[0] - 1), std::min(j + kCoarse, grid.blocks[1] - 1),
                          std::min(k + kCoarse, grid.blocks[2] - 1)},
                         {}});
    }
  }
  return cubes;
}

/// The corners of the nodes of blocks [first, end).
std::pair<Vector3<double>, Vector3<double>> box_of(const SolidGrid& grid, const NodePlace& first,
                                                   const NodePlace& end) {
  return {grid.place_of_node({kSolidBlock * first[0], kSolidBlock * first[1], kSolidBlock * first[2]}),
          grid.place_of_node({kSolidBlock * end[0] - 1, kSolidBlock * end[1] - 1, kSolidBlock * end[2] - 1})};
}

void fuse_cube(const SolidGrid& grid, const std::vector<const SeenDepths*>& views, CoarseCube& cube) {
  const auto [low, high] = box_of(grid, cube.first, cube.end);
  const Verdict all = of_box(views, 0, low, high);
  for (std::int32_t i = cube.first[0]; i < cube.end[0]; ++i) {
    for (std::int32_t j = cube.first[1]; j < cube.end[1]; ++j) {
      for (std::int32_t k = cube.first[2]; k < cube.end[2]; ++k) {
        const NodePlace place = {i, j, k};
        const auto [near, far] = box_of(grid, place, {i + 1, j + 1, k + 1});
        const Verdict verdict = of_box(all.partly, all.free, near, far);
        FusedBlock block{verdict.free > 0 ? SolidGrid::kFree : SolidGrid::kSolid, {}};
        if (!verdict.partly.empty()) block = fused_block(grid, place, verdict);
        cube.blocks.emplace_back(grid.number(place), block);
      }
    }
  }
}

}  // namespace

SolidGrid fused(std::span<const DepthView> views, const FusionSettings& settings) {
  SolidGrid grid = empty_grid(settings);
  std::vector<std::unique_ptr<SeenDepths>> seen(views.size());
  parallel_for(std::ssize(views), 1, [&](Index begin, Index end) {
    for (Index v = begin; v < end; ++v) {
      const auto i = static_cast<std::size_t>(v);
      seen[i] = std::make_unique<SeenDepths>(views[i], settings.truncation * settings.voxel);
    }
  });
  std::vector<const SeenDepths*> all;
  for (const auto& view : seen) all.push_back(view.get());
  constexpr Index kAtATime = 512;  // cubes whose blocks wait to be taken over
  std::vector<CoarseCube> cubes = coarse_cubes(grid);
  for (Index first = 0; first < std::ssize(cubes); first += kAtATime) {
    const Index count = std::min(kAtATime, std::ssize(cubes) - first);
    parallel_for(count, 1, [&](Index begin, Index end) {
      for (Index c = begin; c < end; ++c) fuse_cube(grid, all, cubes[static_cast<std::size_t>(first + c)]);
    });
    for (Index c = first; c < first + count; ++c) {
      for (const auto& [number, block] : std::exchange(cubes[static_cast<std::size_t>(c)].blocks, {})) {
        std::int32_t& of = grid.block[static_cast<std::size_t>(number)];
        of = block.kind;
        if (of < 0) continue;
        of = static_cast<std::int32_t>(grid.values.size());
        grid.values.push_back(block.values);
      }
    }
  }
  return grid;
}

}  // namespace hsi4d
