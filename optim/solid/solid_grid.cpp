#include "optim/solid/solid_grid.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "core/check.h"
#include "core/parallel.h"
#include "core/text.h"

namespace hsi4d {

namespace {

constexpr std::array<NodePlace, 6> kBesides = {{{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}}};

NodePlace moved(const NodePlace& place, const NodePlace& by) {
  return {place[0] + by[0], place[1] + by[1], place[2] + by[2]};
}

/// The block of a node; both may lie outside.
NodePlace block_of(const NodePlace& node) {
  NodePlace block;
  for (std::size_t i = 0; i < 3; ++i)
    block[i] = node[i] >= 0 ? node[i] / kSolidBlock : -((-node[i] + kSolidBlock - 1) / kSolidBlock);
  return block;
}

Index number_in_block(const NodePlace& node) {
  return hsi4d::index_in_block(node[0] & (kSolidBlock - 1), node[1] & (kSolidBlock - 1), node[2] & (kSolidBlock - 1));
}

/// Nodes of one kind that hang together: visits them by blocks where these are all of that kind, else one by one.
class Flood {
 public:
  Flood(const SolidGrid& grid, bool of_free)
      : grid_(grid),
        of_free_(of_free),
        block_seen_(static_cast<std::size_t>(grid.block_count())),
        node_seen_(grid.values.size()) {}

  /// Whether a node is of the kind and not yet visited.
  bool is_new(const NodePlace& node) const {
    const NodePlace block = block_of(node);
    return grid_.holds_block(block) && (grid_.at(node) >= 0) == of_free_ && !is_seen(grid_.number(block), node);
  }

  /// Visits what hangs together with a node that is_new. Returns its nodes.
  Index fill(const NodePlace& node) {
    Index count = mark(node);
    while (!open_.empty()) {
      const NodePlace next = open_.back();
      open_.pop_back();
      count += spread(next);
    }
    return count;
  }

  bool is_seen(Index block, const NodePlace& node) const {
    const std::int32_t values = grid_.block[static_cast<std::size_t>(block)];
    if (values < 0) return block_seen_[static_cast<std::size_t>(block)] != 0;
    return node_seen_[static_cast<std::size_t>(values)][static_cast<std::size_t>(number_in_block(node))] != 0;
  }

  bool touches_outside() const { return touches_outside_; }
  void forget_outside() { touches_outside_ = false; }

 private:
  using Marks = std::array<std::uint8_t, kSolidBlockNodes>;

  /// Marks a node, or its whole block; returns how many nodes. It is spread from later.
  Index mark(const NodePlace& node) {
    const Index block = grid_.number(block_of(node));
    const std::int32_t values = grid_.block[static_cast<std::size_t>(block)];
    open_.push_back(node);
    if (values < 0) {
      block_seen_[static_cast<std::size_t>(block)] = 1;
      return kSolidBlockNodes;
    }
    node_seen_[static_cast<std::size_t>(values)][static_cast<std::size_t>(number_in_block(node))] = 1;
    return 1;
  }

  Index visit(const NodePlace& node) {
    if (!grid_.holds_block(block_of(node))) {
      touches_outside_ = true;
      return 0;
    }
    return is_new(node) ? mark(node) : 0;
  }

  Index spread(const NodePlace& node) {
    const NodePlace block = block_of(node);
    if (grid_.block[static_cast<std::size_t>(grid_.number(block))] < 0) return spread_block(block);
    Index count = 0;
    for (const NodePlace& by : kBesides) count += visit(moved(node, by));
    return count;
  }

  /// To all nodes that lie beside a block.
  Index spread_block(const NodePlace& block) {
    Index count = 0;
    for (const NodePlace& by : kBesides) {
      for (std::int32_t a = 0; a < kSolidBlock; ++a) {
        for (std::int32_t b = 0; b < kSolidBlock; ++b) {
          NodePlace node;
          std::int32_t next = 0;
          for (std::size_t i = 0; i < 3; ++i) {
            const std::int32_t across = next == 0 ? a : b;
            if (by[i] == 0) ++next;
            node[i] = kSolidBlock * block[i] + (by[i] == 0 ? across : by[i] > 0 ? kSolidBlock : -1);
          }
          count += visit(node);
        }
      }
    }
    return count;
  }

  const SolidGrid& grid_;
  bool of_free_;
  bool touches_outside_ = false;
  std::vector<std::uint8_t> block_seen_;
  std::vector<Marks> node_seen_;
  std::vector<NodePlace> open_;
};

template <class F>
void for_each_node(const SolidGrid& grid, Index block, const F& visit) {
  const NodePlace place = grid.place_of_block(block);
  for (std::int32_t i = 0; i < kSolidBlock; ++i) {
    for (std::int32_t j = 0; j < kSolidBlock; ++j) {
      for (std::int32_t k = 0; k < kSolidBlock; ++k)
        visit(NodePlace{kSolidBlock * place[0] + i, kSolidBlock * place[1] + j, kSolidBlock * place[2] + k});
    }
  }
}

/// Makes the nodes of one kind that are not visited, or those that are, of the other kind. Returns how many.
Index turn(SolidGrid& grid, const Flood& flood, bool are_seen, bool to_free) {
  const auto distance = static_cast<float>(to_free ? grid.truncation : -grid.truncation);
  Index turned = 0;
  for (Index b = 0; b < grid.block_count(); ++b) {
    std::int32_t& block = grid.block[static_cast<std::size_t>(b)];
    if (block < 0) {
      const bool is_other = (block == SolidGrid::kFree) != to_free;
      if (!is_other || flood.is_seen(b, {0, 0, 0}) != are_seen) continue;
      block = to_free ? SolidGrid::kFree : SolidGrid::kSolid;
      turned += kSolidBlockNodes;
      continue;
    }
    for_each_node(grid, b, [&](const NodePlace& node) {
      float& value = grid.values[static_cast<std::size_t>(block)][static_cast<std::size_t>(number_in_block(node))];
      if ((value >= 0) == to_free || flood.is_seen(b, node) != are_seen) return;
      value = distance;
      ++turned;
    });
  }
  return turned;
}

/// Visits all nodes of the faces of the grid that are of the flood's kind.
void fill_from_outside(const SolidGrid& grid, Flood& flood) {
  for (Index b = 0; b < grid.block_count(); ++b) {
    const NodePlace place = grid.place_of_block(b);
    bool is_border = false;
    for (std::size_t i = 0; i < 3; ++i) is_border |= place[i] == 0 || place[i] + 1 == grid.blocks[i];
    if (!is_border) continue;
    for_each_node(grid, b, [&](const NodePlace& node) {
      bool is_last = false;
      for (std::size_t i = 0; i < 3; ++i) is_last |= node[i] == 0 || node[i] + 1 == kSolidBlock * grid.blocks[i];
      if (is_last && flood.is_new(node)) flood.fill(node);
    });
  }
}

NodePlace nearest_node(const SolidGrid& grid, const Vector3<double>& point) {
  const Vector3<double> at = (point - grid.origin) / grid.voxel;
  NodePlace node;
  for (Index i = 0; i < 3; ++i)
    node[static_cast<std::size_t>(i)] = static_cast<std::int32_t>(std::lround(std::clamp(at[i], -1e9, 1e9)));
  return node;
}

/// Whether a node beside a block without values is of the other kind.
bool touches_other_kind(const SolidGrid& grid, Index block) {
  const std::int32_t own = grid.block[static_cast<std::size_t>(block)];
  const NodePlace place = grid.place_of_block(block);
  bool differs = false;
  for (std::int32_t n = 0; n < 27; ++n) {
    const NodePlace beside = {place[0] + n / 9 - 1, place[1] + n / 3 % 3 - 1, place[2] + n % 3 - 1};
    const std::int32_t outside = grid.is_outside_free ? SolidGrid::kFree : SolidGrid::kSolid;
    differs |= (grid.holds_block(beside) ? grid.block[static_cast<std::size_t>(grid.number(beside))] : outside) != own;
  }
  if (!differs) return false;
  for (std::int32_t i = -1; i <= kSolidBlock; ++i) {
    for (std::int32_t j = -1; j <= kSolidBlock; ++j) {
      for (std::int32_t k = -1; k <= kSolidBlock; ++k) {
        const NodePlace node = {kSolidBlock * place[0] + i, kSolidBlock * place[1] + j, kSolidBlock * place[2] + k};
        if ((grid.at(node) >= 0) != (own == SolidGrid::kFree)) return true;
      }
    }
  }
  return false;
}

void close_pockets(SolidGrid& grid, std::span<const Vector3<double>> seeds, CleanUp& result) {
  Flood reached(grid, true);
  if (grid.is_outside_free) fill_from_outside(grid, reached);
  for (const Vector3<double>& seed : seeds) {
    const NodePlace node = nearest_node(grid, seed);
    if (reached.is_new(node)) reached.fill(node);
  }
  Flood pockets = reached;  // counts what is left
  for (Index b = 0; b < grid.block_count(); ++b) {
    if (grid.block[static_cast<std::size_t>(b)] == SolidGrid::kSolid) continue;
    for_each_node(grid, b, [&](const NodePlace& node) {
      if (!pockets.is_new(node)) return;
      pockets.fill(node);
      ++result.closed_pockets;
    });
  }
  result.closed_nodes = turn(grid, reached, false, false);
}

void remove_specks(SolidGrid& grid, Index smallest, CleanUp& result) {
  Flood pieces(grid, false);
  std::vector<NodePlace> specks;
  for (Index b = 0; b < grid.block_count(); ++b) {
    if (grid.block[static_cast<std::size_t>(b)] == SolidGrid::kFree) continue;
    for_each_node(grid, b, [&](const NodePlace& node) {
      if (!pieces.is_new(node)) return;
      pieces.forget_outside();
      const Index count = pieces.fill(node);
      if (count < smallest && (grid.is_outside_free || !pieces.touches_outside())) specks.push_back(node);
    });
  }
  Flood removed(grid, false);
  for (const NodePlace& node : specks) removed.fill(node);
  result.removed_specks = static_cast<Index>(specks.size());
  result.removed_nodes = turn(grid, removed, true, true);
}

}  // namespace

NodePlace SolidGrid::place_of_block(Index number) const {
  const Index z = blocks[2], y = blocks[1];
  return {static_cast<std::int32_t>(number / (y * z)), static_cast<std::int32_t>(number / z % y),
          static_cast<std::int32_t>(number % z)};
}

bool SolidGrid::holds_block(const NodePlace& place) const {
  for (std::size_t i = 0; i < 3; ++i) {
    if (place[i] < 0 || place[i] >= blocks[i]) return false;
  }
  return true;
}

float SolidGrid::at(const NodePlace& node) const {
  const NodePlace place = block_of(node);
  const auto limit = static_cast<float>(truncation);
  if (!holds_block(place)) return is_outside_free ? limit : -limit;
  const std::int32_t of = block[static_cast<std::size_t>(number(place))];
  if (of < 0) return of == kFree ? limit : -limit;
  return values[static_cast<std::size_t>(of)][static_cast<std::size_t>(number_in_block(node))];
}

double SolidGrid::at(const Vector3<double>& point) const {
  const Vector3<double> place = (point - origin) / voxel;
  NodePlace low;
  Vector3<double> within;
  for (Index i = 0; i < 3; ++i) {
    const double held = std::clamp(place[i], -1e9, 1e9), floor = std::floor(held);
    low[static_cast<std::size_t>(i)] = static_cast<std::int32_t>(floor);
    within[i] = held - floor;
  }
  double sum = 0;
  for (std::int32_t corner = 0; corner < 8; ++corner) {
    const NodePlace by = {corner >> 2, corner >> 1 & 1, corner & 1};
    double weight = 1;
    for (Index i = 0; i < 3; ++i) weight *= by[static_cast<std::size_t>(i)] != 0 ? within[i] : 1 - within[i];
    if (weight > 0) sum += weight * static_cast<double>(at(moved(low, by)));
  }
  return voxel * sum;
}

Vector3<double> SolidGrid::place_of_node(const NodePlace& node) const {
  return origin + voxel * Vector3<double>(node[0], node[1], node[2]);
}

Index SolidGrid::memory_bytes() const {
  return static_cast<Index>(block.size() * sizeof(std::int32_t) + values.size() * sizeof(Values));
}

std::int32_t with_values(SolidGrid& grid, Index block) {
  std::int32_t& of = grid.block[static_cast<std::size_t>(block)];
  if (of >= 0) return of;
  const auto limit = static_cast<float>(of == SolidGrid::kFree ? grid.truncation : -grid.truncation);
  of = static_cast<std::int32_t>(grid.values.size());
  grid.values.emplace_back().fill(limit);
  return of;
}

CleanUp clean_up(SolidGrid& grid, std::span<const Vector3<double>> seeds, Index smallest) {
  CleanUp result;
  close_pockets(grid, seeds, result);
  remove_specks(grid, smallest, result);
  return result;
}

OccupancyGrid occupancy_of(const SolidGrid& grid, double voxel, bool is_y_up) {
  constexpr double kMostAlong = 16384;
  const double side = static_cast<double>(kSolidBlock) * grid.voxel;
  const Vector3<double> low = grid.origin + Vector3<double>::Constant(side);
  Vector3<double> high = grid.origin;
  for (Index i = 0; i < 3; ++i) high[i] += side * (grid.blocks[static_cast<std::size_t>(i)] - 1);
  OccupancyGrid result;
  result.voxel_size = voxel;
  result.is_y_up = is_y_up;
  result.origin = is_y_up ? Vector3<double>(low[0], low[2], -high[1]) : low;
  const Vector3<double> size = high - low, own = is_y_up ? Vector3<double>(size[0], size[2], size[1]) : size;
  double count = 1;
  for (Index i = 0; i < 3; ++i) {
    const double along = std::max(1.0, std::ceil(own[i] / voxel));
    count *= along;
    if (!(along <= kMostAlong && count <= static_cast<double>(kMostVoxels)))
      throw UserError("voxels of " + number_text(voxel) + " m are too small for a grid of " + number_text(own[0]) +
                      " x " + number_text(own[1]) + " x " + number_text(own[2]) +
                      " m; allowed: " + std::to_string(kMostVoxels) + " voxels");
    result.cells[static_cast<std::size_t>(i)] = static_cast<Index>(along);
  }
  result.occupied.resize(static_cast<std::size_t>(count));
  const Index rows = result.cells[1] * result.cells[2];
  parallel_for(result.cells[0], 1, [&](Index begin, Index end) {
    for (Index n = begin * rows; n < end * rows; ++n) {
      const Vector3<double> cell(static_cast<double>(n / rows),
                                 static_cast<double>(n / result.cells[2] % result.cells[1]),
                                 static_cast<double>(n % result.cells[2]));
      const Vector3<double> at = result.origin + voxel * (cell + Vector3<double>::Constant(0.5));
      const Vector3<double> world = is_y_up ? Vector3<double>(at[0], -at[2], at[1]) : at;
      result.occupied[static_cast<std::size_t>(n)] = grid.at(world) < 0 ? 1 : 0;
    }
  });
  return result;
}

void add_values_at_borders(SolidGrid& grid) {
  std::vector<Index> at_border;
  for (Index b = 0; b < grid.block_count(); ++b) {
    if (grid.block[static_cast<std::size_t>(b)] < 0 && touches_other_kind(grid, b)) at_border.push_back(b);
  }
  for (const Index b : at_border) with_values(grid, b);
}

}  // namespace hsi4d
