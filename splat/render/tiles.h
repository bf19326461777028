// Which tiles a projected Gaussian reaches, and the lists of Gaussians of every tile, in depth order. Used by
// composite.h; not part of the public interface.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <span>
#include <type_traits>
#include <vector>

#include "core/buffer.h"
#include "core/lanes.h"
#include "core/parallel.h"
#include "core/types.h"
#include "splat/render/conic.h"
#include "splat/render_settings.h"

namespace hsi4d::detail {

// --- its tiles -------------------------------------------------------------------------------------------------------

/// The image in square tiles, of a side that is a power of two.
struct TileGrid {
  Index width, height, tile;  ///< pixels
  Index cols, rows;           ///< tiles
  Index count() const { return cols * rows; }
};

TileGrid tile_grid(Index width, Index height, Index tile);

/// Side of a block, pixels: a tile is cut into blocks, and its entries tell which of them a Gaussian may touch. A band
/// is a row of blocks.
inline constexpr Index kBlockSide = 4;

/// The pixels that a Gaussian may touch: of some rows, all in a range of blocks, or those whose centre lies in an
/// ellipse dx = slope dy ± half_width sqrt(reach² − flatness dy²). In float: every number has room for its rounding.
struct alignas(64) Extent {
  enum class Kind : std::int32_t { kRectangle, kEllipse } kind = Kind::kRectangle;
  std::int32_t row_begin = 0, row_end = 0;  ///< of pixels; empty: nothing is drawn
  std::int32_t col_begin = 0, col_end = 0;  ///< of blocks
  // Of kEllipse; dy from the mean, pixels.
  float first_dy = 0;                   ///< of the first row of the row of tiles that row_begin lies in
  float lowest_dy = 0, highest_dy = 0;  ///< of the rows
  float right_dy = 0;                   ///< of the rightmost point; that of the leftmost is its negative
  float x = 0;                          ///< mean, in pixels whose centres are whole numbers
  float slope = 0, half_width = 0, reach_squared = 0, flatness = 0;
  float room = 0;  ///< pixels
};

/// Settings as extents use them.
struct ExtentRules {
  Footprint footprint;
  double alpha_min, log2_alpha_min;
  double epsilon;  ///< of the precision that α is computed in: 1 + epsilon is the next number after 1
};

ExtentRules extent_rules(const RenderSettings& settings, double epsilon);

/// A range of pixels.
struct Pixels {
  Index begin = 0, end = 0;
};

inline Extent rectangle_extent(Pixels rows, Pixels cols) {
  Extent result;
  if (rows.begin >= rows.end || cols.begin >= cols.end) return result;
  result.row_begin = static_cast<std::int32_t>(rows.begin);
  result.row_end = static_cast<std::int32_t>(rows.end);
  result.col_begin = static_cast<std::int32_t>(cols.begin / kBlockSide);
  result.col_end = static_cast<std::int32_t>((cols.end + kBlockSide - 1) / kBlockSide);
  return result;
}

/// Those of INRIA's square of three standard deviations.
Extent square_extent(const Conic& conic, double x, double y, const TileGrid& grid);

/// Numbers of 32 bits beside T, which is double or Lanes of them.
template <class T>
struct Beside {
  static constexpr Index kCount = kLanesOf<T>;
  using Whole = Lanes<std::int32_t, kCount>;
  using Float = Lanes<float, kCount>;
  static Whole whole(const T& x) { return convert_lanes<Whole>(x); }
  static T wide(const Whole& x) { return convert_lanes<T>(x); }
  static Float rounded(const T& x) { return convert_lanes<Float>(x); }
  static Whole mask(const LaneMask<T>& m) { return convert_lanes<Whole>(m); }
};
template <>
struct Beside<double> {
  static constexpr Index kCount = 1;
  using Whole = std::int32_t;
  using Float = float;
  static std::int32_t whole(double x) { return static_cast<std::int32_t>(x); }
  static double wide(std::int32_t x) { return x; }
  static float rounded(double x) { return static_cast<float>(x); }
  static std::int32_t mask(bool m) { return m ? -1 : 0; }
};

/// Ranges of pixels beside T.
template <class T>
struct PixelsOf {
  typename Beside<T>::Whole begin, end;
};

/// Pixels whose centres lie in [low, high], held in [0, size]; none for NaN.
template <class T>
PixelsOf<T> pixels_within(const T& low, const T& high, Index size) {
  using Of = Beside<T>;
  const T zero{}, after = zero + static_cast<double>(size), first = low - 0.5, last = high - 0.5;
  const T from = first < after ? (first > zero ? first : zero) : after;
  const T to = last >= zero ? (last < after ? last : after - 1.0) : zero - 1.0;
  const typename Of::Whole begin = Of::whole(from);  // rounded down: a mask is −1
  return {begin - Of::mask(Of::wide(begin) < from), Of::whole(to) + 1};
}

/// What an ellipse of pixels where α may reach alpha_min is made of. T: double, or Lanes of them.
template <class T>
struct ReachOf {
  T half_width, half_height;                                     ///< of the box around it
  T right_dy, slope, inner_half_width, squared, flatness, room;  ///< as in Extent
};

/// α ≥ alpha_min where u² + w² ≤ 2 ln(o/alpha_min). With room for the rounding of the exponential, the opacity and the
/// logarithms, and of u, whose two terms are as large as the ellipse is (row B7: cut ellipses).
///
/// @param log2_opacity  of an opacity held at or above kLeastOpacity
template <class T>
ReachOf<T> reach_of(const ConicOf<T>& conic, const T& x, const T& log2_opacity, const ExtentRules& rules) {
  constexpr double kTwiceLn2 = 1.3862943611198906188;
  constexpr double kRoom = 1e-6;  // relative, some units in the last place of float
  const double epsilon = rules.epsilon;
  const T exact = lane_sqrt(T(lane_max(T(kTwiceLn2 * (log2_opacity - rules.log2_alpha_min)), 0.0) + 64 * epsilon));
  const T inverse_yy = conic.l22 * conic.l22;
  const T width = lane_sqrt(conic.xx), height = conic.yy * conic.l22;
  const T reach = exact * (1.0 + 16 * epsilon * (1.0 + conic.l11 * width + lane_abs(conic.l21) * height));
  return {reach * width,
          reach * height,
          reach * conic.xy / width,
          conic.xy * inverse_yy,
          conic.l11 * conic.determinant * inverse_yy,  // 1/l11
          reach * reach * (1 + 2 * kRoom),
          inverse_yy,
          1e-4 + kRoom * (lane_abs(x) + reach * width)};
}

/// Extents, number by number; see Extent.
template <class T>
struct ExtentOf {
  typename Beside<T>::Whole is_ellipse;  ///< a mask
  PixelsOf<T> rows, cols;
  typename Beside<T>::Float first_dy, lowest_dy, highest_dy, right_dy, x, slope, half_width, reach_squared, flatness,
      room;
};

/// The extents of ellipses around (x, y).
template <class T>
ExtentOf<T> extent_within(const ReachOf<T>& reach, const T& x, const T& y, const TileGrid& grid) {
  using Of = Beside<T>;
  constexpr double kFar = 1e6;  // pixels: beyond, float is not enough
  ExtentOf<T> e;
  e.rows = pixels_within(T(y - reach.half_height), T(y + reach.half_height), grid.height);
  e.cols = pixels_within(T(x - reach.half_width), T(x + reach.half_width), grid.width);
  e.is_ellipse =
      Of::mask((lane_abs(x) < kFar) & (lane_abs(y) < kFar) & (reach.half_width < kFar) & (reach.half_height < kFar));
  const T first_row = Of::wide(e.rows.begin & -static_cast<std::int32_t>(grid.tile));
  e.first_dy = Of::rounded(first_row + 0.5 - y);
  e.lowest_dy = Of::rounded(lane_max(T(Of::wide(e.rows.begin) + 0.5 - y), T(-reach.half_height)));
  e.highest_dy = Of::rounded(-lane_max(T(y - (Of::wide(e.rows.end) - 0.5)), T(-reach.half_height)));
  e.right_dy = Of::rounded(reach.right_dy);
  e.x = Of::rounded(x - 0.5);
  e.slope = Of::rounded(reach.slope);
  e.half_width = Of::rounded(reach.inner_half_width);
  e.reach_squared = Of::rounded(reach.squared);
  e.flatness = Of::rounded(reach.flatness);
  e.room = Of::rounded(reach.room);
  return e;
}

/// Number i of T, which is the only one of a double.
template <class T>
auto lane(const T& x, [[maybe_unused]] Index i) {
  if constexpr (std::is_arithmetic_v<T>) {
    return x;
  } else {
    return x[i];
  }
}

/// Extent i.
template <class T>
Extent extent_at(const ExtentOf<T>& e, Index i) {
  Extent result =
      rectangle_extent({lane(e.rows.begin, i), lane(e.rows.end, i)}, {lane(e.cols.begin, i), lane(e.cols.end, i)});
  if (result.row_begin >= result.row_end || lane(e.is_ellipse, i) == 0) return result;
  result.kind = Extent::Kind::kEllipse;
  result.first_dy = lane(e.first_dy, i);
  result.lowest_dy = lane(e.lowest_dy, i);
  result.highest_dy = lane(e.highest_dy, i);
  result.right_dy = lane(e.right_dy, i);
  result.x = lane(e.x, i);
  result.slope = lane(e.slope, i);
  result.half_width = lane(e.half_width, i);
  result.reach_squared = lane(e.reach_squared, i);
  result.flatness = lane(e.flatness, i);
  result.room = lane(e.room, i);
  return result;
}

/// Whether an extent is that of an ellipse where α may reach alpha_min.
inline bool is_of_ellipse(const ExtentRules& rules) {
  return rules.footprint != Footprint::kSquare3Sigma && rules.alpha_min > 0;
}

/// False: α is below alpha_min everywhere.
template <class T>
LaneMask<T> may_be_drawn(const T& opacity, const ExtentRules& rules) {
  return opacity >= rules.alpha_min * (1 - 4 * rules.epsilon);
}

/// The extent that rules ask for. It never leaves out a pixel where min(cap, o G) ≥ alpha_min, with room for the
/// rounding of the arithmetic (row B7: cut ellipses).
///
/// @param opacity  o, with the antialias factor
/// @param reach    by reach_of, for a footprint that asks for it
inline Extent extent_of(const Conic& conic, double x, double y, double opacity, const ReachOf<double>& reach,
                        const TileGrid& grid, const ExtentRules& rules) {
  if (rules.footprint == Footprint::kSquare3Sigma) return square_extent(conic, x, y, grid);
  if (!is_of_ellipse(rules)) return rectangle_extent({0, grid.height}, {0, grid.width});
  if (!may_be_drawn(opacity, rules)) return {};
  return extent_at(extent_within(reach, x, y, grid), 0);
}

/// Tiles of the box around an extent.
inline Index tiles_around(const Extent& extent, const TileGrid& grid) {
  if (extent.row_begin >= extent.row_end) return 0;
  const int shift = std::countr_zero(static_cast<std::uint32_t>(grid.tile));
  const Index rows = ((extent.row_end - 1) >> shift) - (extent.row_begin >> shift) + 1;
  const Index cols = ((extent.col_end * kBlockSide - 1) >> shift) - ((extent.col_begin * kBlockSide) >> shift) + 1;
  return rows * cols;
}

// --- order -----------------------------------------------------------------------------------------------------------

/// Bits whose order as whole numbers is that of the depths (row B9: all signs, −0 as 0).
inline std::uint64_t depth_bits(float depth) {
  const std::uint32_t bits = std::bit_cast<std::uint32_t>(depth + 0.0f);  // −0 + 0 = 0
  return bits ^ (bits >> 31 != 0 ? 0xFFFFFFFFu : 0x80000000u);
}

inline std::uint64_t depth_bits(double depth) {
  const std::uint64_t bits = std::bit_cast<std::uint64_t>(depth + 0.0);
  return bits ^ (bits >> 63 != 0 ? ~std::uint64_t(0) : std::uint64_t(1) << 63);
}

struct DepthKeyed {
  std::uint64_t key;
  std::int32_t index;
};

/// Sorts by key; equal keys stay in order. Returns whichever of the two arrays, of the same length, holds the result.
std::span<DepthKeyed> sort_by_depth(std::span<DepthKeyed> keys, std::span<DepthKeyed> room);

// --- lists -----------------------------------------------------------------------------------------------------------

/// Of pairs without an adjoint.
inline constexpr std::uint32_t kNoSlot = 0xFFFFFFFF;

struct TileEntry {
  std::int32_t index;    ///< row of the inputs
  std::uint32_t slot;    ///< of this (tile, Gaussian) pair; those of a Gaussian follow each other
  std::uint32_t blocks;  ///< bit r · (blocks across) + c: may touch that block
};

/// The sum of the numbers of pairs. Throws UserError if it is above kMostPairs (row B10: too many pairs).
Index total_pairs(std::span<const Index> pairs);

/// Most bytes that the pairs of an image may take: kPairMemoryShare of the machine's memory.
Index pair_memory_limit();

/// Throws UserError if `bytes` is above `limit` (row B10: too many pairs).
///
/// @param pairs  that ask for the bytes
void check_pair_memory(Index pairs, double bytes, Index limit);

/// Bands that are looked at together.
inline constexpr std::int32_t kBands = 8;

/// Columns of blocks that an extent reaches in kBands bands; begin > end: none.
struct BandSpans {
  std::int32_t begin[kBands], end[kBands];
};

/// The spans of the bands from `first` on, counted from the first one of the row of tiles that extent.row_begin lies
/// in. Loops without branches: vectors.
inline void band_spans(const Extent& f, const TileGrid& grid, std::int32_t first, BandSpans& spans) {
  constexpr std::int32_t kSide = kBlockSide, kNone = std::numeric_limits<std::int32_t>::max();
  const float width = static_cast<float>(grid.width), start = f.first_dy + static_cast<float>(first * kSide);
  for (std::int32_t i = 0; i < kBands; ++i) {
    const float top = start + static_cast<float>(i * kSide), bottom = top + static_cast<float>(kSide - 1);
    const float low = std::max(top, f.lowest_dy), high = std::max(std::min(bottom, f.highest_dy), low);
    const float right_dy = std::min(std::max(f.right_dy, low), high);
    const float left_dy = std::min(std::max(-f.right_dy, low), high);
    const float right_half = std::sqrt(std::max(f.reach_squared - right_dy * right_dy * f.flatness, 0.0f));
    const float left_half = std::sqrt(std::max(f.reach_squared - left_dy * left_dy * f.flatness, 0.0f));
    const float right = f.slope * right_dy + f.half_width * right_half;
    const float left = f.slope * left_dy - f.half_width * left_half;
    const float begin = std::min(std::max(std::ceil(f.x + left - f.room), 0.0f), width);
    const float end = std::min(std::max(std::floor(f.x + right + f.room) + 1, 0.0f), width);
    constexpr float kSlack = 0.25f;  // rows are a pixel apart, and their places rounded
    const bool some = (begin < end) & (top <= f.highest_dy + kSlack) & (bottom >= f.lowest_dy - kSlack);
    const std::int32_t from = static_cast<std::int32_t>(begin) / kSide;
    const std::int32_t to = (static_cast<std::int32_t>(end) + kSide - 1) / kSide;
    spans.begin[i] = some ? from : kNone;
    spans.end[i] = some ? to : 0;
  }
  if (f.kind == Extent::Kind::kEllipse) return;
  const std::int32_t tile = static_cast<std::int32_t>(grid.tile), row = f.row_begin / tile * tile + first * kSide;
  for (std::int32_t i = 0; i < kBands; ++i) {
    const bool some = row + (i + 1) * kSide > f.row_begin && row + i * kSide < f.row_end;
    spans.begin[i] = some ? f.col_begin : kNone;
    spans.end[i] = some ? f.col_end : 0;
  }
}

/// Columns of blocks that are looked at together.
inline constexpr std::int32_t kWindow = 16;

/// Calls visit(tile, columns, words) for windows of tiles that cover an extent, rows of windows first: `words` are the
/// kBands × kWindow blocks of kBands / kAcross rows of tiles from `tile` on, for blocks_of_tile; those of tiles from
/// column `columns` on are none.
///
/// @param kAcross  blocks across a tile
template <std::int32_t kAcross, class F>
inline void for_each_window(const Extent& extent, const TileGrid& grid, const F& visit) {
  constexpr std::int32_t kRows = kBands / kAcross, kTile = kAcross * kBlockSide;
  const std::int32_t first_row = extent.row_begin / kTile, after_row = (extent.row_end + kTile - 1) / kTile;
  const std::int32_t first_col = extent.col_begin / kAcross, after_col = (extent.col_end + kAcross - 1) / kAcross;
  for (std::int32_t row = first_row; row < after_row; row += kRows) {
    BandSpans spans;
    band_spans(extent, grid, (row - first_row) * kAcross, spans);
    for (std::int32_t col = first_col; col < after_col; col += kWindow / kAcross) {
      const std::int32_t width = std::min(kWindow, (after_col - col) * kAcross);
      std::uint16_t bands[kBands];
      for (std::int32_t i = 0; i < kBands; ++i) {
        const std::int32_t from = std::min(std::max(spans.begin[i] - col * kAcross, 0), width);
        const std::int32_t to = std::max(std::min(spans.end[i] - col * kAcross, width), from);
        bands[i] = static_cast<std::uint16_t>((1u << to) - (1u << from));
      }
      std::array<std::uint64_t, 2> words;
      std::memcpy(words.data(), bands, sizeof bands);
      visit(static_cast<Index>(row) * grid.cols + col, width / kAcross, words);
    }
  }
}

/// The blocks of the tile in row r and column c of a window.
template <std::int32_t kAcross>
inline std::uint32_t blocks_of_tile(const std::array<std::uint64_t, 2>& words, std::int32_t r, std::int32_t c) {
  if constexpr (kAcross == 4) {
    std::uint64_t bits = words[static_cast<std::size_t>(r)] >> (4 * c) & 0x000F000F000F000F;
    bits |= bits >> 12;
    return static_cast<std::uint32_t>((bits | bits >> 24) & 0xFFFF);
  } else {
    const std::uint64_t bits = words[static_cast<std::size_t>(r / 2)] >> (32 * (r % 2) + 2 * c) & 0x00030003;
    return static_cast<std::uint32_t>((bits | bits >> 14) & 0xF);
  }
}

/// Calls visit(tile, blocks) for every tile that an extent reaches: the order of its slots.
template <std::int32_t kAcross, class F>
inline void for_each_tile(const Extent& extent, const TileGrid& grid, const F& visit) {
  for_each_window<kAcross>(extent, grid,
                           [&](Index tile, std::int32_t columns, const std::array<std::uint64_t, 2>& words) {
                             for (std::int32_t c = 0; c < columns; ++c) {
                               for (std::int32_t r = 0; r < kBands / kAcross; ++r) {
                                 const std::uint32_t blocks = blocks_of_tile<kAcross>(words, r, c);
                                 if (blocks != 0) visit(tile + r * grid.cols + c, blocks);
                               }
                             }
                           });
}

template <class F>
inline void for_each_tile(const Extent& extent, const TileGrid& grid, const F& visit) {
  if (extent.row_begin >= extent.row_end) return;
  grid.tile == 16 ? for_each_tile<4>(extent, grid, visit) : for_each_tile<2>(extent, grid, visit);
}

/// A pair as it is found.
struct FoundPair {
  std::uint32_t tile, blocks;
};

/// The Gaussians of every tile.
class TileLists {
 public:
  struct Slots {
    std::uint32_t begin, end;
  };
  Buffer<Index> tile_begin;   ///< [tiles + 1] into entries
  Buffer<Index> tile_groups;  ///< [tiles] (block, Gaussian) pairs
  Buffer<Slots> slots;        ///< [N] of each Gaussian, in the order of the rows
  Buffer<TileEntry> entries;  ///< by tile, then in depth order

  Index pairs() const { return pairs_; }
  /// Tile of a slot.
  Index tile_of(Index slot) const { return pair_at(slot).tile; }

  /// Finds the pairs of all Gaussians: slots, tile_begin, tile_groups. Parallel; the result depends on the arguments
  /// alone. Returns the number of pairs; if there are more than `most`, none is kept, no memory is taken for them (row
  /// B10), and the caller must not go on. Throws as total_pairs.
  ///
  /// @param extents  [N] in the order of the rows; empty ones of rows that are not drawn
  /// @param bound    the sum of their tiles_around: where it is above `most`, pairs are counted before any is kept
  Index find(std::span<const Extent> extents, const TileGrid& grid, Index most, Index bound);
  /// Fills entries, after find.
  ///
  /// @param order  every row whose extent is not empty, in depth order
  /// @param first  what entries call row 0
  void deal(std::span<const DepthKeyed> order, const TileGrid& grid, std::int32_t first);
  Index capacity_bytes() const;

 private:
  const FoundPair& pair_at(Index slot) const { return found_[static_cast<std::size_t>(slot)]; }
  void join(const Partition& part, std::span<const Index> sizes);

  Index pairs_ = 0;
  std::vector<FoundPair> found_;                 // [≥ pairs] of each slot
  std::vector<std::vector<FoundPair>> of_part_;  // of parts of the rows, when there are several
  Buffer<std::uint64_t> totals_;                 // [parts][tiles] pairs, and in the upper half groups
  Buffer<std::uint32_t> next_;                   // [parts of the order][tiles] where the next entry goes
};

}  // namespace hsi4d::detail
