#include "body/directions.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "body/directions_kernel.h"
#include "core/huge_pages.h"
#include "core/parallel.h"

namespace hsi4d {

using detail::DirectionTile;
using detail::DirectionTiles;
using detail::kDirectionGrain;
using detail::kDirectionLanes;
using detail::kTileRows;
using detail::kTileVertices;

namespace {

constexpr double kLargestPacked = 32767;
/// Tiles of smaller numbers are not packed: their scale would be denormal in float.
constexpr double kSmallestPackable = 1e-20;

template <class S>
const detail::DirectionKernels<S>& kernels() {
  static const detail::DirectionKernels<S> table = detail::direction_kernels<S>(best_isa());
  return table;
}

/// Largest number of a tile.
double largest_of(const DirectionSource& source, Index block, Index group) {
  const Index end = std::min((block + 1) * kTileRows, 3 * source.vertices);
  double largest = 0;
  for (Index row = block * kTileRows; row < end; ++row) {
    const double* p =
        source.values.data() + row * source.row_stride + source.group_begin[static_cast<std::size_t>(group)];
    for (Index c = 0; c < source.group_columns; ++c) largest = std::max(largest, std::abs(p[c]));
  }
  return largest;
}

/// Which tiles of a block are packed, and the error that this makes: see the top of directions.h.
std::vector<bool> packed_tiles(const std::vector<double>& largest, const DirectionPacking& packing, double& error) {
  std::vector<std::size_t> order(largest.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return largest[a] < largest[b]; });
  std::vector<bool> packed(largest.size(), false);
  error = 0;
  for (const std::size_t group : order) {
    if (largest[group] < kSmallestPackable) continue;
    const double more = packing.reach * largest[group] / kLargestPacked / 2;
    if (!(error + more <= packing.largest_error)) break;
    error += more;
    packed[group] = true;
  }
  return packed;
}

/// Calls put(column, row of the tile, number) for the numbers of a tile.
template <class F>
void for_numbers(const DirectionSource& source, Index block, Index group, F&& put) {
  const Index end = std::min((block + 1) * kTileRows, 3 * source.vertices);
  for (Index row = block * kTileRows; row < end; ++row) {
    const double* p =
        source.values.data() + row * source.row_stride + source.group_begin[static_cast<std::size_t>(group)];
    for (Index c = 0; c < source.group_columns; ++c) put(c, row - block * kTileRows, p[c]);
  }
}

template <class S>
void fill_tile(const DirectionSource& source, Index block, Index group, const DirectionTile& tile,
               DirectionTiles<S>& table) {
  if (tile.is_packed) {
    std::int16_t* to = table.packed.data() + tile.offset;
    std::fill(to, to + tile.columns * kTileRows, std::int16_t{0});
    for_numbers(source, block, group, [&](Index c, Index row, double x) {
      to[c * kTileRows + row] = static_cast<std::int16_t>(std::lround(x / tile.scale));
    });
  } else {
    S* to = table.numbers.data() + tile.offset;
    std::fill(to, to + tile.columns * kTileRows, S(0));
    for_numbers(source, block, group,
                [&](Index c, Index row, double x) { to[c * kTileRows + row] = static_cast<S>(x); });
  }
}

void check_source(const DirectionSource& source) {
  const auto size = static_cast<Index>(source.values.size());
  HSI4D_CHECK_EQ(size, 3 * source.vertices * source.row_stride);
  for (const Index begin : source.group_begin) {
    HSI4D_CHECK(begin >= 0 && source.group_columns >= 1 && begin + source.group_columns <= source.row_stride,
                "columns from " + std::to_string(begin) + " of " + std::to_string(source.row_stride));
  }
}

/// The tiles of all blocks with their offsets.
template <class S>
void plan_tiles(const DirectionSource& source, const DirectionPacking& packing, DirectionTiles<S>& table,
                std::vector<Index>& groups) {
  const auto group_count = static_cast<Index>(source.group_begin.size());
  const Index blocks = (source.vertices + kTileVertices - 1) / kTileVertices;
  Index numbers = 0, packed_numbers = 0;
  std::vector<double> largest(static_cast<std::size_t>(group_count));
  table.block_begin.push_back(0);
  for (Index block = 0; block < blocks; ++block) {
    for (Index g = 0; g < group_count; ++g) largest[static_cast<std::size_t>(g)] = largest_of(source, block, g);
    double error = 0;
    const bool may_pack = sizeof(S) == sizeof(float) && packing.largest_error > 0;
    const std::vector<bool> packed =
        may_pack ? packed_tiles(largest, packing, error) : std::vector<bool>(largest.size(), false);
    table.largest_error = std::max(table.largest_error, error);
    for (Index g = 0; g < group_count; ++g) {
      const auto at = static_cast<std::size_t>(g);
      if (largest[at] == 0) continue;
      Index& used = packed[at] ? packed_numbers : numbers;
      table.tiles.push_back({static_cast<std::int32_t>(g * source.group_columns),
                             static_cast<std::int32_t>(source.group_columns), packed[at],
                             packed[at] ? largest[at] / kLargestPacked : 1.0, used});
      groups.push_back(g);
      used += source.group_columns * kTileRows;
    }
    table.block_begin.push_back(static_cast<Index>(table.tiles.size()));
  }
  table.numbers.resize(numbers);
  table.packed.resize(packed_numbers);
  advise_huge_pages(table.numbers.data(), table.numbers.capacity_bytes());
  advise_huge_pages(table.packed.data(), table.packed.capacity_bytes());
}

}  // namespace

template <class S>
Directions<S>::Directions(const DirectionSource& source, const DirectionPacking& packing) {
  check_source(source);
  auto table = std::make_shared<DirectionTiles<S>>();
  table->vertices = source.vertices;
  table->columns = static_cast<Index>(source.group_begin.size()) * source.group_columns;
  std::vector<Index> groups;
  plan_tiles(source, packing, *table, groups);
  parallel_for(table->blocks(), 16, [&](Index begin, Index end) {
    for (Index block = begin; block < end; ++block) {
      for (Index t = table->block_begin[static_cast<std::size_t>(block)];
           t < table->block_begin[static_cast<std::size_t>(block + 1)]; ++t) {
        const auto at = static_cast<std::size_t>(t);
        fill_tile(source, block, groups[at], table->tiles[at], *table);
      }
    }
  });
  tiles_ = std::move(table);
}

template <class S>
Index Directions<S>::vertices() const {
  return tiles_ ? tiles_->vertices : 0;
}

template <class S>
Index Directions<S>::columns() const {
  return tiles_ ? tiles_->columns : 0;
}

template <class S>
Index Directions<S>::bytes() const {
  return tiles_ ? tiles_->numbers.size() * static_cast<Index>(sizeof(S)) + tiles_->packed.size() * 2 : 0;
}

template <class S>
double Directions<S>::largest_error() const {
  return tiles_ ? tiles_->largest_error : 0;
}

template <class S>
void add_directions(const Directions<S>& directions, const S* coefficients, const S* points, S* result) {
  const DirectionTiles<S>& table = directions.tiles();
  parallel_for(table.vertices, kDirectionGrain, [&](Index begin, Index end) {
    kernels<S>().add(table, coefficients, points, result, begin / kTileVertices,
                     (end + kTileVertices - 1) / kTileVertices);
  });
}

template <class S>
Index gather_scratch(const Directions<S>& directions) {
  return Partition{directions.vertices(), kDirectionGrain}.chunks() * directions.columns() * kDirectionLanes;
}

template <class S>
void gather_directions(const Directions<S>& directions, const S* d_result, S* scratch, double* sums) {
  const DirectionTiles<S>& table = directions.tiles();
  const Partition part{table.vertices, kDirectionGrain};
  const Index numbers = table.columns * kDirectionLanes, chunks = part.chunks();
  parallel_chunks(part, [&](Index chunk, Index begin, Index end) {
    kernels<S>().gather(table, d_result, scratch + chunk * numbers, begin / kTileVertices,
                        (end + kTileVertices - 1) / kTileVertices);
  });
  on_best_isa([&] {
    for (Index c = 0; c < table.columns; ++c) {
      double lanes[kDirectionLanes] = {};
      for (Index chunk = 0; chunk < chunks; ++chunk) {
        const S* partial = scratch + chunk * numbers + c * kDirectionLanes;
        for (Index i = 0; i < kDirectionLanes; ++i) lanes[i] += static_cast<double>(partial[i]);
      }
      double sum = 0;
      for (const double x : lanes) sum += x;
      sums[c] = sum;
    }
  });
}

#define HSI4D_INSTANTIATE(S)                                                  \
  template class Directions<S>;                                               \
  template void add_directions(const Directions<S>&, const S*, const S*, S*); \
  template Index gather_scratch(const Directions<S>&);                        \
  template void gather_directions(const Directions<S>&, const S*, S*, double*);
HSI4D_INSTANTIATE(float)
HSI4D_INSTANTIATE(double)
#undef HSI4D_INSTANTIATE

}  // namespace hsi4d
