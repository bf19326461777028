// band_spans and for_each_tile of tiles.h in vectors: kBands rows of blocks at a time, and tiles without a branch.
// The same operations in the same order, without fused ones: the same pairs on every instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "splat/render/tile_finder.cpp"
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_SSE4 | HWY_AVX3_DL)
// clang-format off
#include <hwy/foreach_target.h>
// clang-format on
#include "splat/render/tile_finder.h"

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

/// Tiles that may be reached.
struct Tiles {
  std::int32_t first_row, after_row, first_col, after_col;
  Index count() const { return static_cast<Index>(after_row - first_row) * (after_col - first_col); }
};

template <std::int32_t kAcross>
HWY_INLINE Tiles tiles_of(const Extent& extent) {
  constexpr std::int32_t kTile = kAcross * kBlockSide;
  return {extent.row_begin / kTile, (extent.row_end + kTile - 1) / kTile, extent.col_begin / kAcross,
          (extent.col_end + kAcross - 1) / kAcross};
}

/// Where pairs go.
struct Place {
  FoundPair* to;
  std::uint64_t* totals;
};

/// Writes the pairs of a window, and one after them that is none; adds them to the totals.
///
/// @param corner   the tile of its first row and column
/// @param columns  of tiles
template <std::int32_t kAcross>
HWY_INLINE void add_window(const std::array<std::uint64_t, 2>& words, Index corner, std::int32_t columns, Index cols,
                           Place& place) {
  constexpr std::int32_t kColumns = 2;  // looked at without asking whether they are reached
  for (std::int32_t c = 0; c < columns; c += kColumns) {
    for (std::int32_t i = c; i < c + kColumns; ++i) {
      for (std::int32_t r = 0; r < kBands / kAcross; ++r) {
        const std::uint32_t blocks = blocks_of_tile<kAcross>(words, r, i);
        const Index tile = corner + r * cols + i;
        const std::uint64_t some = blocks != 0 ? 1 : 0;
        *place.to = {static_cast<std::uint32_t>(tile), blocks};
        place.to += some;
        place.totals[tile] += (static_cast<std::uint64_t>(std::popcount(blocks)) << 32) + some;
      }
    }
  }
}

/// All windows of an extent.
template <std::int32_t kAcross>
void add_extent(const Extent& extent, const Tiles& tiles, const TileGrid& grid, VF width, Place& place) {
  for (std::int32_t row = tiles.first_row; row < tiles.after_row; row += kBands / kAcross) {
    const std::int32_t band = (row - tiles.first_row) * kAcross;
    const Spans spans = extent.kind == Extent::Kind::kEllipse ? ellipse_spans(extent, width, band)
                                                              : rectangle_spans(extent, grid, band);
    for (std::int32_t col = tiles.first_col; col < tiles.after_col; col += kWindow / kAcross) {
      const std::int32_t columns = std::min(kWindow / kAcross, tiles.after_col - col);
      const auto words = window_words(spans, col * kAcross, columns * kAcross);
      add_window<kAcross>(words, static_cast<Index>(row) * grid.cols + col, columns, grid.cols, place);
    }
  }
}

/// In two steps over some rows at a time: words of ellipses of one window, without a branch that the processor could
/// guess wrong, then the pairs.
template <std::int32_t kAcross>
Index find(std::span<const Extent> extents, const TileGrid& grid, Index most, const PairSink& sink) {
  constexpr size_t kTogether = 32;
  const VF width = hn::Set(DF(), static_cast<float>(grid.width));
  TileLists::Slots* slots = sink.slots;
  Index count = 0, room = static_cast<Index>(sink.found.size());
  std::array<std::uint64_t, 2> words[kTogether];
  for (; !extents.empty(); extents = extents.subspan(std::min(kTogether, extents.size()))) {
    const auto some = extents.first(std::min(kTogether, extents.size()));
    for (size_t i = 0; i < some.size(); ++i) {
      const Tiles tiles = tiles_of<kAcross>(some[i]);
      words[i] = window_words(ellipse_spans(some[i], width, 0), tiles.first_col * kAcross,
                              std::min(kWindow, (tiles.after_col - tiles.first_col) * kAcross));
    }
    for (size_t i = 0; i < some.size(); ++i) {
      const Extent& extent = some[i];
      const Index first = count;
      if (extent.row_begin < extent.row_end) {
        const Tiles tiles = tiles_of<kAcross>(extent);
        const Index at = count < most ? count : 0, needed = at + tiles.count() + 1;
        if (room < needed) {
          room = std::max(needed, room + room / 2);
          sink.found.resize(static_cast<size_t>(room));
        }
        FoundPair* const begin = sink.found.data() + at;
        Place place{begin, sink.totals};
        const std::int32_t rows = tiles.after_row - tiles.first_row, cols = tiles.after_col - tiles.first_col;
        if (extent.kind == Extent::Kind::kEllipse && rows <= kBands / kAcross && cols <= kWindow / kAcross) {
          const Index corner = static_cast<Index>(tiles.first_row) * grid.cols + tiles.first_col;
          add_window<kAcross>(words[i], corner, cols, grid.cols, place);
        } else {
          add_extent<kAcross>(extent, tiles, grid, width, place);
        }
        count += place.to - begin;
      }
      *slots++ = {static_cast<std::uint32_t>(first), static_cast<std::uint32_t>(count)};
    }
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
