// Vector kernels of directions_kernel.h: rows in the lanes, a tile's columns one after the other.
//
// One core cannot read a single stream of memory as fast as several: kStreams blocks are worked on side by side, tile
// by tile, with their rows in the first-level cache.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "body/directions_kernel.cpp"
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_SSE4 | HWY_AVX3_DL)
#include "body/directions_kernel.h"

#include <algorithm>

#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace hsi4d::detail::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

template <class S>
using Tag = hn::CappedTag<S, kDirectionLanes>;
template <class S>
inline constexpr Index kLanes = static_cast<Index>(hn::MaxLanes(Tag<S>()));

/// Vectors of rows that are worked on at once, in registers.
inline constexpr int kHeld = 6;
template <class S>
inline constexpr Index kHeldRows = kHeld* kLanes<S>;
static_assert(kTileRows % kHeldRows<float> == 0 && kTileRows % kHeldRows<double> == 0);

template <class S>
HWY_INLINE hn::Vec<Tag<S>> load(const S* from) {
  return hn::LoadU(Tag<S>(), from);
}
template <class S>
HWY_INLINE hn::Vec<Tag<S>> load(const std::int16_t* from) {
  const Tag<S> d;
  if constexpr (sizeof(S) == 4) {
    const hn::Rebind<std::int32_t, Tag<S>> whole;
    return hn::ConvertTo(d, hn::PromoteTo(whole, hn::LoadU(hn::Rebind<std::int16_t, Tag<S>>(), from)));
  } else {
    return hn::Zero(d);  // double is never packed
  }
}

/// rows += Σ_c coefficients[c] numbers[c]
template <class S, class T>
HWY_INLINE void add_tile(const T* HWY_RESTRICT numbers, const S* HWY_RESTRICT coefficients, Index columns, S scale,
                         S* HWY_RESTRICT rows) {
  const Tag<S> d;
  for (Index first = 0; first < kTileRows; first += kHeldRows<S>) {
    hn::Vec<Tag<S>> sum[kHeld];
#pragma GCC unroll 6
    for (int i = 0; i < kHeld; ++i) sum[i] = load<S>(rows + first + i * kLanes<S>);
    for (Index c = 0; c < columns; ++c) {
      const auto by = hn::Set(d, coefficients[c] * scale);
#pragma GCC unroll 6
      for (int i = 0; i < kHeld; ++i) {
        sum[i] = hn::MulAdd(load<S>(numbers + c * kTileRows + first + i * kLanes<S>), by, sum[i]);
      }
    }
#pragma GCC unroll 6
    for (int i = 0; i < kHeld; ++i) hn::StoreU(sum[i], d, rows + first + i * kLanes<S>);
  }
}

/// partial[c] += scale · Σ rows numbers[c], lane by lane
template <class S, class T>
HWY_INLINE void gather_tile(const T* HWY_RESTRICT numbers, const S* HWY_RESTRICT rows, Index columns, S scale,
                            S* HWY_RESTRICT partial) {
  const Tag<S> d;
  const auto by = hn::Set(d, scale);
  for (Index first = 0; first < kTileRows; first += kHeldRows<S>) {
    hn::Vec<Tag<S>> row[kHeld];
#pragma GCC unroll 6
    for (int i = 0; i < kHeld; ++i) row[i] = load<S>(rows + first + i * kLanes<S>);
    for (Index c = 0; c < columns; ++c) {
      const T* HWY_RESTRICT from = numbers + c * kTileRows + first;
      auto even = hn::Mul(load<S>(from), row[0]), odd = hn::Mul(load<S>(from + kLanes<S>), row[1]);
#pragma GCC unroll 4
      for (int i = 2; i < kHeld; i += 2) {
        even = hn::MulAdd(load<S>(from + i * kLanes<S>), row[i], even);
        odd = hn::MulAdd(load<S>(from + (i + 1) * kLanes<S>), row[i + 1], odd);
      }
      S* HWY_RESTRICT to = partial + c * kDirectionLanes;
      hn::StoreU(hn::MulAdd(hn::Add(even, odd), by, load<S>(to)), d, to);
    }
  }
}

/// Blocks that are worked on side by side; calls f(block, tile) for all their tiles.
template <class S, class F>
HWY_INLINE void for_tiles(const DirectionTiles<S>& table, Index begin, Index end, F&& f) {
  Index most = 0;
  for (Index b = begin; b < end; ++b) {
    most = std::max(
        most, table.block_begin[static_cast<std::size_t>(b + 1)] - table.block_begin[static_cast<std::size_t>(b)]);
  }
  for (Index t = 0; t < most; ++t) {
    for (Index b = begin; b < end; ++b) {
      const Index tile = table.block_begin[static_cast<std::size_t>(b)] + t;
      if (tile < table.block_begin[static_cast<std::size_t>(b + 1)]) f(b, table.tiles[static_cast<std::size_t>(tile)]);
    }
  }
}

/// Copies the rows of blocks [begin, end) that there are; the others of the last block are 0.
template <class S>
HWY_INLINE void load_rows(const S* from, Index vertices, Index begin, Index end, S* rows) {
  const Index first = begin * kTileRows, last = std::min(end * kTileRows, 3 * vertices);
  std::copy(from + first, from + last, rows);
  std::fill(rows + (last - first), rows + (end - begin) * kTileRows, S(0));
}

template <class S>
void add(const DirectionTiles<S>& table, const S* coefficients, const S* points, S* result, Index begin, Index end) {
  alignas(64) S rows[kStreams * kTileRows];
  for (Index first = begin; first < end; first += kStreams) {
    const Index last = std::min(first + kStreams, end);
    std::fill(rows, rows + (last - first) * kTileRows, S(0));  // points come last: sums of displacements round less
    for_tiles(table, first, last, [&](Index block, const DirectionTile& tile) {
      S* to = rows + (block - first) * kTileRows;
      const S* by = coefficients + tile.column;
      if (tile.is_packed) {
        add_tile<S>(table.packed.data() + tile.offset, by, tile.columns, static_cast<S>(tile.scale), to);
      } else {
        add_tile<S>(table.numbers.data() + tile.offset, by, tile.columns, S(1), to);
      }
    });
    const Index row = first * kTileRows, count = std::min(last * kTileRows, 3 * table.vertices) - row;
    for (Index i = 0; i < count; ++i) result[row + i] = points[row + i] + rows[i];
  }
}

template <class S>
void gather(const DirectionTiles<S>& table, const S* d_result, S* partial, Index begin, Index end) {
  alignas(64) S rows[kStreams * kTileRows];
  std::fill(partial, partial + table.columns * kDirectionLanes, S(0));
  for (Index last = end; last > begin;) {
    const Index first = begin + (last - begin - 1) / kStreams * kStreams;
    load_rows(d_result, table.vertices, first, last, rows);
    for_tiles(table, first, last, [&](Index block, const DirectionTile& tile) {
      const S* from = rows + (block - first) * kTileRows;
      S* to = partial + tile.column * kDirectionLanes;
      if (tile.is_packed) {
        gather_tile<S>(table.packed.data() + tile.offset, from, tile.columns, static_cast<S>(tile.scale), to);
      } else {
        gather_tile<S>(table.numbers.data() + tile.offset, from, tile.columns, S(1), to);
      }
    });
    last = first;
  }
}

}  // namespace

template <class S>
void set_kernels(DirectionKernels<S>& kernels) {
  kernels.add = add<S>;
  kernels.gather = gather<S>;
}
template void set_kernels(DirectionKernels<float>&);
template void set_kernels(DirectionKernels<double>&);

}  // namespace hsi4d::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace hsi4d::detail {

template <class S>
DirectionKernels<S> direction_kernels([[maybe_unused]] Isa isa) {
  DirectionKernels<S> kernels{};
#if (HWY_TARGETS & HWY_AVX3) && HWY_STATIC_TARGET != HWY_AVX3
  if (isa == Isa::kAvx512) {
    N_AVX3::set_kernels(kernels);
    return kernels;
  }
#endif
#if (HWY_TARGETS & HWY_AVX2) && HWY_STATIC_TARGET != HWY_AVX2
  if (isa == Isa::kAvx2) {
    N_AVX2::set_kernels(kernels);
    return kernels;
  }
#endif
  HWY_STATIC_DISPATCH(set_kernels)(kernels);
  return kernels;
}
template DirectionKernels<float> direction_kernels(Isa);
template DirectionKernels<double> direction_kernels(Isa);

}  // namespace hsi4d::detail
#endif
