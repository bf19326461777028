// Vector kernels of directions_kernel.h: rows in the lanes, a tile's columns one after the other.
//
// The numbers come from beyond the second-level cache, in one stream. They are asked for kAhead bytes before they are
// used: the processor's own prefetching stops at each page and reads half as fast.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "body/directions_kernel.cpp"
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_SSE4 | HWY_AVX3_DL)
#include "body/directions_kernel.h"

#include <algorithm>

#include <hwy/cache_control.h>
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

/// Asks for the column that lies kAhead bytes behind this one; what that is, if it is at all, does not matter.
template <class T>
HWY_INLINE void prefetch(const T* column) {
  constexpr std::size_t kAhead = 4096, kLine = 64;
  const char* from = reinterpret_cast<const char*>(column) + kAhead;
#pragma GCC unroll 12
  for (std::size_t at = 0; at < kTileRows * sizeof(T); at += kLine) hwy::Prefetch(from + at);
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
      if (first == 0) prefetch(numbers + c * kTileRows);
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
      if (first == 0) prefetch(numbers + c * kTileRows);
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

/// Calls f(numbers, scale, tile) for the tiles of a block, with its numbers as they are kept.
template <class S, class F>
HWY_INLINE void for_tiles(const DirectionTiles<S>& table, Index block, F&& f) {
  const auto at = static_cast<std::size_t>(block);
  for (Index t = table.block_begin[at]; t < table.block_begin[at + 1]; ++t) {
    const DirectionTile& tile = table.tiles[static_cast<std::size_t>(t)];
    if (tile.is_packed) {
      f(table.packed.data() + tile.offset, static_cast<S>(tile.scale), tile);
    } else {
      f(table.numbers.data() + tile.offset, S(1), tile);
    }
  }
}

template <class S>
void add(const DirectionTiles<S>& table, const S* coefficients, const S* points, S* result, Index begin, Index end) {
  alignas(64) S rows[kTileRows];
  for (Index block = begin; block < end; ++block) {
    std::fill(rows, rows + kTileRows, S(0));  // points come last: sums of displacements round less
    for_tiles(table, block, [&](const auto* numbers, S scale, const DirectionTile& tile) {
      add_tile<S>(numbers, coefficients + tile.column, tile.columns, scale, rows);
    });
    const Index first = block * kTileRows, count = std::min(kTileRows, 3 * table.vertices - first);
    for (Index i = 0; i < count; ++i) result[first + i] = points[first + i] + rows[i];
  }
}

template <class S>
void gather(const DirectionTiles<S>& table, const S* d_result, S* partial, Index begin, Index end) {
  alignas(64) S rows[kTileRows];
  std::fill(partial, partial + table.columns * kDirectionLanes, S(0));
  for (Index block = begin; block < end; ++block) {
    const Index first = block * kTileRows, count = std::min(kTileRows, 3 * table.vertices - first);
    std::copy(d_result + first, d_result + first + count, rows);
    std::fill(rows + count, rows + kTileRows, S(0));
    for_tiles(table, block, [&](const auto* numbers, S scale, const DirectionTile& tile) {
      gather_tile<S>(numbers, rows, tile.columns, scale, partial + tile.column * kDirectionLanes);
    });
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
