// Which tiles a projected Gaussian reaches, and the lists of Gaussians of every tile, in depth order. Used by
// composite.h; not part of the public interface.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "core/buffer.h"
#include "core/types.h"
#include "splat/conic.h"
#include "splat/render_settings.h"

namespace hsi4d::detail {

// --- its tiles -------------------------------------------------------------------------------------------------------

/// The image in square tiles.
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
  std::int32_t col_begin = 0, col_end = 0;  ///< of kRectangle, columns of blocks
  // Of kEllipse; dy from the mean, pixels.
  float first_dy = 0;                   ///< of the first row of the row of tiles that row_begin lies in
  float lowest_dy = 0, highest_dy = 0;  ///< of the rows
  float right_dy = 0;                   ///< of the rightmost point; that of the leftmost is its negative
  float x = 0;                          ///< mean, in pixels whose centres are whole numbers
  float slope = 0, half_width = 0, reach_squared = 0, flatness = 0;
  float room = 0;  ///< pixels
};

/// The extent that settings ask for. It never leaves out a pixel where min(cap, o G) ≥ alpha_min, with room for the
/// rounding of arithmetic in which 1 + `epsilon` is the next number after 1 (row B7).
///
/// @param opacity  o, with the antialias factor
/// @param epsilon  of the precision that α is computed in
Extent extent_of(const Conic& conic, double x, double y, double opacity, const TileGrid& grid,
                 const RenderSettings& settings, double epsilon);

// --- order -----------------------------------------------------------------------------------------------------------

/// Bits whose order as whole numbers is that of the depths (row B9: all signs, −0 as 0).
std::uint64_t depth_bits(float depth);
std::uint64_t depth_bits(double depth);

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

/// The sum of the numbers of pairs. Throws UserError if it is above kMostPairs (row B10).
Index total_pairs(std::span<const Index> pairs);

/// Most bytes that the pairs of an image may take: kPairMemoryShare of the machine's memory.
Index pair_memory_limit();

/// Throws UserError if `bytes` is above `limit` (row B10).
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

/// Calls visit(tile, blocks) for every tile that an extent reaches: the order of its slots.
///
/// @param kAcross  blocks across a tile
template <std::int32_t kAcross, class F>
inline void for_each_tile(const Extent& extent, const TileGrid& grid, const F& visit) {
  const std::int32_t first_row = extent.row_begin / static_cast<std::int32_t>(grid.tile);
  const std::int32_t last_row = (extent.row_end - 1) / static_cast<std::int32_t>(grid.tile);
  constexpr std::int32_t kRows = kBands / kAcross;
  for (std::int32_t row = first_row; row <= last_row; row += kRows) {
    BandSpans spans;
    band_spans(extent, grid, (row - first_row) * kAcross, spans);
    std::int32_t first = spans.begin[0], after = spans.end[0];
    for (std::int32_t i = 1; i < kBands; ++i) {
      first = std::min(first, spans.begin[i]);
      after = std::max(after, spans.end[i]);
    }
    for (std::int32_t block = first / kAcross * kAcross; block < after; block += kAcross) {
      std::uint32_t bits[kBands];
      for (std::int32_t i = 0; i < kBands; ++i) {
        const std::int32_t from = std::min(std::max(spans.begin[i] - block, 0), kAcross);
        const std::int32_t to = std::min(std::max(spans.end[i] - block, from), kAcross);
        bits[i] = ((1u << to) - (1u << from)) << (i % kAcross * kAcross);
      }
      for (std::int32_t r = 0; r < kRows; ++r) {
        std::uint32_t blocks = 0;
        for (std::int32_t i = 0; i < kAcross; ++i) blocks |= bits[r * kAcross + i];
        if (blocks != 0) visit(static_cast<Index>(row + r) * grid.cols + block / kAcross, blocks);
      }
    }
  }
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
  Buffer<Index> tile_begin;       ///< [tiles + 1] into entries
  Buffer<Index> tile_groups;      ///< [tiles] (block, Gaussian) pairs
  Buffer<Slots> slots;            ///< [N] of each Gaussian, in the order of the rows; none of those not in `order`
  Buffer<std::uint32_t> tile_of;  ///< [pairs] tile of a slot
  Buffer<TileEntry> entries;

  Index pairs() const { return entries.size(); }

  /// Finds the pairs of Gaussians in depth order, and places them: slots, tile_begin, tile_groups. Parallel; the result
  /// depends on the arguments alone. Keeps `most` pairs or somewhat more; a caller who is told of more must not go on.
  /// Returns the number of pairs. Throws as total_pairs.
  ///
  /// @param order    rows of `extents`
  /// @param extents  [N]
  Index find(std::span<const DepthKeyed> order, std::span<const Extent> extents, const TileGrid& grid, Index most);
  /// Fills entries and tile_of, after find with the same arguments.
  void fill(std::span<const DepthKeyed> order, const TileGrid& grid);
  Index capacity_bytes() const;

 private:
  void place_tiles(Index tiles, Index chunks);

  std::vector<std::vector<FoundPair>> found_;  // of each chunk of the order
  Buffer<std::uint32_t> counts_;               // [chunks][tiles]
  Buffer<std::uint32_t> groups_;               // [chunks][tiles]
};

}  // namespace hsi4d::detail
