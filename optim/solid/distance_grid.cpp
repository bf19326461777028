#include "optim/solid/distance_grid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/buffer.h"
#include "core/check.h"
#include "core/parallel.h"
#include "core/text.h"

namespace hsi4d {

namespace {

using Point = Vector3<double>;

constexpr Index kNodes = kBlockCells + 1;
constexpr std::int64_t kHalfRange = 1 << 20;  // blocks along an axis, each way
constexpr Index kPointGrain = 1024;

/// Coordinates in blocks, and in cells of the block.
struct GridPlace {
  std::array<std::int64_t, 3> cell;  // in the block
  Point within;                      // of the cell, 0 to 1
};

GridPlace place_in_block(const Point& place, double cell_size) {
  GridPlace result{};
  for (int i = 0; i < 3; ++i) {
    const double cells = place[i] / cell_size, floor = std::floor(cells);
    const auto cell = static_cast<std::int64_t>(floor);
    result.cell[static_cast<std::size_t>(i)] = ((cell % kBlockCells) + kBlockCells) % kBlockCells;
    result.within[i] = cells - floor;
  }
  return result;
}

Index node_at(std::int64_t x, std::int64_t y, std::int64_t z) { return (z * kNodes + y) * kNodes + x; }

std::int64_t packed(const std::array<std::int64_t, 3>& block) {
  return ((block[2] + kHalfRange) * 2 * kHalfRange + block[1] + kHalfRange) * 2 * kHalfRange + block[0] + kHalfRange;
}

/// The block's lower corner, in cells.
Point corner_of(std::int64_t number) {
  Point corner;
  for (int i = 0; i < 3; ++i) {
    corner[i] = static_cast<double>((number % (2 * kHalfRange) - kHalfRange) * kBlockCells);
    number /= 2 * kHalfRange;
  }
  return corner;
}

}  // namespace

DistanceGrid::DistanceGrid(Distance distance, Settings settings)
    : distance_(std::move(distance)), settings_(std::move(settings)) {
  HSI4D_CHECK(settings_.cell > 0, "the cells have no size");
}

std::int64_t DistanceGrid::block_number(const Vector3<double>& place) const {
  std::array<std::int64_t, 3> block{};
  for (int i = 0; i < 3; ++i) {
    // By whole cells, as place_in_block cuts: a place on the rounded edge of a block then is in one of the two for
    // both.
    const double cell = std::floor(place[i] / settings_.cell), number = std::floor(cell / kBlockCells);
    if (!(std::fabs(number) < static_cast<double>(kHalfRange))) return kNoBlock;
    block[static_cast<std::size_t>(i)] = static_cast<std::int64_t>(number);
  }
  return packed(block);
}

DistanceGrid::Block DistanceGrid::sampled(std::int64_t number) const {
  const Point corner = corner_of(number);
  const Point middle = (corner + Point::Constant(0.5 * kBlockCells)) * settings_.cell;
  const double half_diagonal = 0.5 * kBlockCells * std::sqrt(3.0) * settings_.cell;
  Block block;
  if (distance_(middle) > half_diagonal + settings_.reach) return block;
  block.nodes.resize(static_cast<std::size_t>(kNodes * kNodes * kNodes));
  for (Index z = 0; z < kNodes; ++z) {
    for (Index y = 0; y < kNodes; ++y) {
      for (Index x = 0; x < kNodes; ++x) {
        const Point node =
            (corner + Point(static_cast<double>(x), static_cast<double>(y), static_cast<double>(z))) * settings_.cell;
        block.nodes[static_cast<std::size_t>(node_at(x, y, z))] = static_cast<float>(distance_(node));
      }
    }
  }
  return block;
}

void DistanceGrid::find(std::span<const std::int64_t> numbers, std::span<const Block*> found) {
  std::vector<std::int64_t> missing;
  {
    const std::lock_guard lock(mutex_);
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      found[i] = nullptr;
      if (numbers[i] == kNoBlock) continue;
      const auto at = blocks_.find(numbers[i]);
      if (at == blocks_.end()) {
        missing.push_back(numbers[i]);
      } else {
        found[i] = at->second.get();
      }
    }
  }
  if (missing.empty()) return;
  std::sort(missing.begin(), missing.end());
  missing.erase(std::unique(missing.begin(), missing.end()), missing.end());
  std::vector<std::unique_ptr<const Block>> made(missing.size());
  // Without the lock: a thread that waits here may be given another part of the program's work.
  parallel_for(std::ssize(missing), 1, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i)
      made[static_cast<std::size_t>(i)] = std::make_unique<const Block>(sampled(missing[static_cast<std::size_t>(i)]));
  });
  const std::lock_guard lock(mutex_);
  for (std::size_t i = 0; i < missing.size(); ++i) {
    const auto [at, is_new] = blocks_.try_emplace(missing[i], std::move(made[i]));
    if (!is_new) continue;
    bytes_ += static_cast<Index>(sizeof(Block) + at->second->nodes.capacity() * sizeof(float));
    sampled_ += at->second->nodes.empty() ? 0 : 1;
    if (bytes_ > settings_.most_bytes)
      throw UserError(settings_.name + ": its grid of cells of " + number_text(settings_.cell) + " m takes more than " +
                      number_text(static_cast<double>(settings_.most_bytes) / (1 << 20)) +
                      " MiB; larger cells take less");
  }
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    if (numbers[i] != kNoBlock && found[i] == nullptr) found[i] = blocks_.at(numbers[i]).get();
  }
}

DistanceSample DistanceGrid::at(const Vector3<double>& place, const Block* block) const {
  if (block == nullptr || block->nodes.empty()) return {};
  const GridPlace p = place_in_block(place, settings_.cell);
  DistanceSample sample{0, Point::Zero()};
  for (unsigned corner = 0; corner < 8; ++corner) {
    std::array<double, 3> weight{}, slope{};
    std::array<std::int64_t, 3> node = p.cell;
    for (unsigned i = 0; i < 3; ++i) {
      const bool upper = (corner >> i & 1U) != 0;
      node[i] += upper ? 1 : 0;
      weight[i] = upper ? p.within[i] : 1 - p.within[i];
      slope[i] = upper ? 1 : -1;
    }
    const auto value = static_cast<double>(block->nodes[static_cast<std::size_t>(node_at(node[0], node[1], node[2]))]);
    if (std::isnan(value)) return {};
    sample.distance += value * weight[0] * weight[1] * weight[2];
    sample.gradient += value * Point(slope[0] * weight[1] * weight[2], weight[0] * slope[1] * weight[2],
                                     weight[0] * weight[1] * slope[2]);
  }
  sample.gradient /= settings_.cell;
  return sample;
}

DistanceSample DistanceGrid::at(const Vector3<double>& place) {
  const std::int64_t number = block_number(place);
  const Block* block = nullptr;
  find({&number, 1}, {&block, 1});
  return at(place, block);
}

std::uint64_t DistanceGrid::cell_in_block(const Vector3<double>& place) const {
  const GridPlace p = place_in_block(place, settings_.cell);
  return static_cast<std::uint64_t>(node_at(p.cell[0], p.cell[1], p.cell[2]));
}

Index DistanceGrid::memory_bytes() const {
  const std::lock_guard lock(mutex_);
  return bytes_;
}

Index DistanceGrid::sampled_blocks() const {
  const std::lock_guard lock(mutex_);
  return sampled_;
}

Index DistanceGrid::blocks() const {
  const std::lock_guard lock(mutex_);
  return static_cast<Index>(blocks_.size());
}

// --- on the tape -----------------------------------------------------------------------------------------------------

namespace {

template <class S>
struct SampledDistance {
  static constexpr const char* kName = "sampled_distance";

  std::shared_ptr<DistanceGrid> grid;
  Buffer<std::int64_t> numbers = {};  // of each point's block, in the last run
  Buffer<const DistanceGrid::Block*> blocks = {};
  Buffer<std::array<double, 3>> gradients = {};
  bool has_run = false;

  Index saved_bytes() const { return numbers.capacity_bytes() + blocks.capacity_bytes() + gradients.capacity_bytes(); }

  static Point point_at(const ConstArray<S>& points, Index row) {
    const S* x = points.row(row);
    return {static_cast<double>(x[0]), static_cast<double>(x[1]), static_cast<double>(x[2])};
  }

  void find_blocks(const ConstArray<S>& points) {
    const Index count = points.shape.rows;
    bool has_moved = !has_run;
    if (!has_run) {
      numbers.resize(count);
      blocks.resize(count);
      gradients.resize(count);
    }
    for (Index p = 0; p < count; ++p) {
      const std::int64_t number = grid->block_number(point_at(points, p));
      has_moved = has_moved || numbers[p] != number;
      numbers[p] = number;
    }
    has_run = false;  // until the blocks are found
    if (has_moved) grid->find(numbers.span(), blocks.span());
    has_run = true;
  }

  void forward(NodeIo<S>& io) {
    const ConstArray<S> points = io.in(0);
    const Array<S> y = io.out();
    find_blocks(points);
    parallel_for(points.shape.rows, kPointGrain, [&](Index begin, Index end) {
      for (Index p = begin; p < end; ++p) {
        const Point place = point_at(points, p);
        const DistanceSample sample = grid->at(place, blocks[p]);
        const bool is_finite = std::isfinite(place[0] + place[1] + place[2]);
        *y.row(p) = is_finite ? static_cast<S>(sample.distance) : std::numeric_limits<S>::quiet_NaN();
        gradients[p] = {sample.gradient[0], sample.gradient[1], sample.gradient[2]};
      }
    });
  }

  void backward(NodeIo<S>& io) {
    const ConstArray<S> d_y = io.d_out();
    const Array<S> d_points = io.d_in(0);
    parallel_for(d_points.shape.rows, kPointGrain, [&](Index begin, Index end) {
      for (Index p = begin; p < end; ++p) {
        const auto d = static_cast<double>(*d_y.row(p));
        for (int i = 0; i < 3; ++i) d_points.row(p)[i] += static_cast<S>(d * gradients[p][static_cast<std::size_t>(i)]);
      }
    });
  }

  void add_signature(Signature& signature, NodeIo<S>& io) {
    const ConstArray<S> points = io.in(0);
    for (Index p = 0; p < points.shape.rows; ++p) {
      signature.add(static_cast<std::uint64_t>(numbers[p]));
      if (numbers[p] != DistanceGrid::kNoBlock) signature.add(grid->cell_in_block(point_at(points, p)));
    }
  }
};

}  // namespace

template <class S>
Var<S> sampled_distance(Var<S> points, std::shared_ptr<DistanceGrid> grid, Source where) {
  const Index count = points.shape().rows;
  HSI4D_CHECK_EQ(points.shape(), shape_of(count, 3));
  HSI4D_CHECK(grid != nullptr, "there is no distance");
  SampledDistance<S> op;
  op.grid = std::move(grid);
  return points.owner().record(std::move(op), {points}, shape_of(count, 1), where);
}

template Var<float> sampled_distance(Var<float>, std::shared_ptr<DistanceGrid>, Source);
template Var<double> sampled_distance(Var<double>, std::shared_ptr<DistanceGrid>, Source);

}  // namespace hsi4d
