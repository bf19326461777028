// band_spans and for_each_tile of tiles.h in vectors: kBands rows of blocks at a time, and tiles without a branch.
// The same operations in the same order, without fused ones: the same pairs on every instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "splat/tile_finder.cpp"
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_SSE4 | HWY_AVX3_DL)
// clang-format off
#include <hwy/foreach_target.h>
// clang-format on
#include "splat/tile_finder.h"

#include <bit>

#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace hsi4d::detail::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using DF = hn::CappedTag<float, kBands>;
using DI = hn::RebindToSigned<DF>;
using VF = hn::Vec<DF>;
using VI = hn::Vec<DI>;
constexpr int kBandLanes = static_cast<int>(hn::MaxLanes(DF()));
constexpr int kBandParts = kBands / kBandLanes;

/// BandSpans.
struct Spans {
  VI begin[kBandParts], end[kBandParts];
};

HWY_INLINE Spans rectangle_spans(const Extent& f, const TileGrid& grid, std::int32_t first) {
  BandSpans spans;
  band_spans(f, grid, first, spans);
  Spans r;
  for (int j = 0; j < kBandParts; ++j) {
    r.begin[j] = hn::LoadU(DI(), spans.begin + j * kBandLanes);
    r.end[j] = hn::LoadU(DI(), spans.end + j * kBandLanes);
  }
  return r;
}

/// Half of the ellipse's width at dy, over half_width.
HWY_INLINE VF half_at(const Extent& f, VF dy) {
  const DF d;
  return hn::Sqrt(
      hn::Max(hn::Sub(hn::Set(d, f.reach_squared), hn::Mul(hn::Mul(dy, dy), hn::Set(d, f.flatness))), hn::Zero(d)));
}

HWY_INLINE Spans ellipse_spans(const Extent& f, VF width, std::int32_t first) {
  constexpr float kSide = kBlockSide;
  constexpr float kSlack = 0.25f;  // see band_spans
  const DF d;
  const DI di;
  const VF start = hn::Set(d, f.first_dy + static_cast<float>(first * kBlockSide));
  const VF lowest = hn::Set(d, f.lowest_dy), highest = hn::Set(d, f.highest_dy), zero = hn::Zero(d);
  const VF slope = hn::Set(d, f.slope), half_width = hn::Set(d, f.half_width);
  const VF x = hn::Set(d, f.x), room = hn::Set(d, f.room);
  Spans r;
  for (int j = 0; j < kBandParts; ++j) {
    const VF top = hn::Add(start, hn::Mul(hn::Iota(d, static_cast<float>(j * kBandLanes)), hn::Set(d, kSide)));
    const VF bottom = hn::Add(top, hn::Set(d, kSide - 1));
    const VF low = hn::Max(top, lowest), high = hn::Max(hn::Min(bottom, highest), low);
    const VF right_dy = hn::Min(hn::Max(hn::Set(d, f.right_dy), low), high);
    const VF left_dy = hn::Min(hn::Max(hn::Set(d, -f.right_dy), low), high);
    const VF right = hn::Add(hn::Mul(slope, right_dy), hn::Mul(half_width, half_at(f, right_dy)));
    const VF left = hn::Sub(hn::Mul(slope, left_dy), hn::Mul(half_width, half_at(f, left_dy)));
    const VF begin = hn::Min(hn::Max(hn::Ceil(hn::Sub(hn::Add(x, left), room)), zero), width);
    const VF after = hn::Add(hn::Floor(hn::Add(hn::Add(x, right), room)), hn::Set(d, 1.0f));
    const VF end = hn::Min(hn::Max(after, zero), width);
    const auto some = hn::And(hn::Lt(begin, end), hn::And(hn::Le(top, hn::Set(d, f.highest_dy + kSlack)),
                                                          hn::Ge(bottom, hn::Set(d, f.lowest_dy - kSlack))));
    const VI last = hn::Add(hn::ConvertTo(di, end), hn::Set(di, kBlockSide - 1));
    static_assert(kBlockSide == 4);
    r.begin[j] = hn::ShiftRight<2>(hn::ConvertTo(di, begin));
    r.end[j] = hn::IfThenElseZero(hn::RebindMask(di, some), hn::ShiftRight<2>(last));
  }
  return r;
}

/// Words of a window, see for_each_window.
HWY_INLINE std::array<std::uint64_t, 2> window_words(const Spans& spans, std::int32_t first, std::int32_t width) {
  const DI di;
  const hn::Rebind<std::uint16_t, DI> d16;
  const VI zero = hn::Zero(di), one = hn::Set(di, 1), wide = hn::Set(di, width), start = hn::Set(di, first);
  HWY_ALIGN std::uint16_t bands[kBands];
  for (int j = 0; j < kBandParts; ++j) {
    const VI from = hn::Min(hn::Max(hn::Sub(spans.begin[j], start), zero), wide);
    const VI to = hn::Max(hn::Min(hn::Sub(spans.end[j], start), wide), from);
    hn::Store(hn::DemoteTo(d16, hn::Sub(hn::Shl(one, to), hn::Shl(one, from))), d16, bands + j * kBandLanes);
  }
  std::array<std::uint64_t, 2> words;
  std::memcpy(words.data(), bands, sizeof bands);
  return words;
}

/// Writes the pairs of an extent, and one after them that is none; adds them to the totals. Returns the end.
template <std::int32_t kAcross>
HWY_INLINE FoundPair* pairs_of(const Extent& extent, const TileGrid& grid, VF width, FoundPair* to,
                               std::uint64_t* totals) {
  constexpr std::int32_t kRows = kBands / kAcross, kTile = kAcross * kBlockSide;
  constexpr std::int32_t kColumns = 2;  // looked at without asking whether they are reached
  const std::int32_t first_row = extent.row_begin / kTile, after_row = (extent.row_end + kTile - 1) / kTile;
  const std::int32_t first_col = extent.col_begin / kAcross, after_col = (extent.col_end + kAcross - 1) / kAcross;
  for (std::int32_t row = first_row; row < after_row; row += kRows) {
    const std::int32_t band = (row - first_row) * kAcross;
    const Spans spans = extent.kind == Extent::Kind::kEllipse ? ellipse_spans(extent, width, band)
                                                              : rectangle_spans(extent, grid, band);
    for (std::int32_t col = first_col; col < after_col; col += kWindow / kAcross) {
      const std::int32_t columns = std::min(kWindow / kAcross, after_col - col);
      const std::array<std::uint64_t, 2> words = window_words(spans, col * kAcross, columns * kAcross);
      const Index corner = static_cast<Index>(row) * grid.cols + col;
      for (std::int32_t c = 0; c < columns; c += kColumns) {
        for (std::int32_t i = c; i < c + kColumns; ++i) {
          for (std::int32_t r = 0; r < kRows; ++r) {
            const std::uint32_t blocks = blocks_of_tile<kAcross>(words, r, i);
            const Index tile = corner + r * grid.cols + i;
            const std::uint64_t some = blocks != 0 ? 1 : 0;
            *to = {static_cast<std::uint32_t>(tile), blocks};
            to += some;
            totals[tile] += (static_cast<std::uint64_t>(std::popcount(blocks)) << 32) + some;
          }
        }
      }
    }
  }
  return to;
}

/// Tiles that an extent may reach.
template <std::int32_t kAcross>
HWY_INLINE Index most_tiles(const Extent& extent) {
  constexpr std::int32_t kTile = kAcross * kBlockSide;
  const Index rows = (extent.row_end + kTile - 1) / kTile - extent.row_begin / kTile;
  const Index cols = (extent.col_end + kAcross - 1) / kAcross - extent.col_begin / kAcross;
  return rows * cols;
}

template <std::int32_t kAcross>
Index find(std::span<const Extent> extents, const TileGrid& grid, Index most, const PairSink& sink) {
  const VF width = hn::Set(DF(), static_cast<float>(grid.width));
  TileLists::Slots* slots = sink.slots;
  Index count = 0, room = static_cast<Index>(sink.found.size());
  for (const Extent& extent : extents) {
    const Index first = count;
    if (extent.row_begin < extent.row_end) {
      const Index at = count < most ? count : 0;
      const Index needed = at + most_tiles<kAcross>(extent) + 1;
      if (room < needed) {
        room = std::max(needed, room + room / 2);
        sink.found.resize(static_cast<std::size_t>(room));
      }
      FoundPair* const begin = sink.found.data() + at;
      count += pairs_of<kAcross>(extent, grid, width, begin, sink.totals) - begin;
    }
    *slots++ = {static_cast<std::uint32_t>(first), static_cast<std::uint32_t>(count)};
  }
  return count;
}

Index find_in(std::span<const Extent> extents, const TileGrid& grid, Index most, const PairSink& sink) {
  return grid.tile == 16 ? find<4>(extents, grid, most, sink) : find<2>(extents, grid, most, sink);
}

}  // namespace hsi4d::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace hsi4d::detail {
HWY_EXPORT(find_in);

Index find_pairs(std::span<const Extent> extents, const TileGrid& grid, Index most, const PairSink& sink) {
  return HWY_DYNAMIC_DISPATCH(find_in)(extents, grid, most, sink);
}
}  // namespace hsi4d::detail
#endif
