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

struct TileSpan {
  Index begin = 0, end = 0;
};

/// The pixels that a Gaussian may touch: all; or a rectangle of tiles; or those whose centre lies in an ellipse.
struct Extent {
  enum class Kind : std::uint8_t { kAll, kRectangle, kEllipse } kind = Kind::kAll;
  Index row_begin = 0, row_end = 0;   ///< rows of pixels; empty: nothing is drawn
  TileSpan cols;                      ///< of kRectangle, columns of tiles
  double x = 0, y = 0;                ///< mean, pixels
  double reach = 0;                   ///< sqrt(u² + w²) at the border
  double slope = 0;                   ///< xy/yy: how far the middle of a row moves with dy
  double half_width = 0;              ///< sqrt(det/yy): half a row's width at the centre is reach times this
  double top_x = 0, inverse_l22 = 0;  ///< dy of the rightmost point, sqrt(yy): both for reach 1
  double box_half_width = 0;          ///< pixels
};

/// The extent that settings ask for. It never leaves out a pixel where min(cap, o G) ≥ alpha_min, with room for the
/// rounding of arithmetic in which 1 + `epsilon` is the next number after 1 (row B7).
///
/// @param opacity  o, with the antialias factor
/// @param epsilon  of the precision that α is computed in
Extent extent_of(const Conic& conic, double x, double y, double opacity, const TileGrid& grid,
                 const RenderSettings& settings, double epsilon);

/// Side of a block, pixels: a tile is cut into blocks, and its entries tell which of them a Gaussian may touch.
inline constexpr Index kBlockSide = 4;

/// Columns of blocks that an extent reaches in one band of blocks (rows kBlockSide · band and on).
TileSpan block_columns(const Extent& extent, const TileGrid& grid, Index band);

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

/// Bands of blocks that are looked at together.
inline constexpr Index kBands = 16;

/// Columns of blocks that an extent reaches in kBands bands.
struct BandSpans {
  std::int32_t begin[kBands], end[kBands];
};

/// The spans of bands first, first + 1, … of an ellipse: those of block_columns or slightly more, in float.
inline void ellipse_spans(const Extent& f, const TileGrid& grid, Index first, BandSpans& spans) {
  // Of the border of the ellipse around its mean; widened by what rounding may lose.
  const float half_height = static_cast<float>(f.reach * f.inverse_l22);
  const float lowest = std::max(static_cast<float>(static_cast<double>(f.row_begin) + 0.5 - f.y), -half_height);
  const float highest = std::min(static_cast<float>(static_cast<double>(f.row_end) - 0.5 - f.y), half_height);
  const float start = static_cast<float>(static_cast<double>(first * kBlockSide) + 0.5 - f.y);
  const float top_dy = static_cast<float>(f.reach * f.top_x), slope = static_cast<float>(f.slope);
  const float reach_squared = static_cast<float>(f.reach * f.reach * (1 + 2e-6));
  const float flatness = static_cast<float>(1 / (f.inverse_l22 * f.inverse_l22));
  const float half_width = static_cast<float>(f.half_width), x = static_cast<float>(f.x - 0.5);
  const float room = static_cast<float>(1e-4 + 1e-6 * (std::abs(f.x) + f.box_half_width));
  const float width = static_cast<float>(grid.width);
  constexpr std::int32_t kSide = kBlockSide;
  constexpr float kSlack = 0.25f;  // rows are a pixel apart, and their places rounded
  for (Index i = 0; i < kBands; ++i) {
    const float top = start + static_cast<float>(i * kBlockSide);
    const float low = std::max(top, lowest), high = std::max(std::min(top + (kBlockSide - 1), highest), low);
    const float right_dy = std::min(std::max(top_dy, low), high), left_dy = std::min(std::max(-top_dy, low), high);
    const float right =
        slope * right_dy + half_width * std::sqrt(std::max(reach_squared - right_dy * right_dy * flatness, 0.0f));
    const float left =
        slope * left_dy - half_width * std::sqrt(std::max(reach_squared - left_dy * left_dy * flatness, 0.0f));
    const float begin = std::min(std::max(std::ceil(x + left - room), 0.0f), width);
    const float end = std::min(std::max(std::floor(x + right + room) + 1, 0.0f), width);
    const bool some = begin < end && top <= highest + kSlack && top + (kBlockSide - 1) >= lowest - kSlack;
    const std::int32_t first_pixel = static_cast<std::int32_t>(begin), after = static_cast<std::int32_t>(end);
    spans.begin[i] = some ? first_pixel / kSide : std::numeric_limits<std::int32_t>::max();
    spans.end[i] = some ? (after + kSide - 1) / kSide : 0;
  }
}

/// The spans of kBands bands.
inline void band_spans(const Extent& f, const TileGrid& grid, Index first, BandSpans& spans) {
  constexpr double kFar = 1e6;  // pixels: beyond, float is not enough
  if (f.kind == Extent::Kind::kEllipse && std::abs(f.x) < kFar && std::abs(f.y) < kFar && f.box_half_width < kFar &&
      f.reach * f.inverse_l22 < kFar) {
    return ellipse_spans(f, grid, first, spans);
  }
  for (Index i = 0; i < kBands; ++i) {
    const TileSpan span = block_columns(f, grid, first + i);
    const bool some = span.begin < span.end;
    spans.begin[i] = some ? static_cast<std::int32_t>(span.begin) : std::numeric_limits<std::int32_t>::max();
    spans.end[i] = some ? static_cast<std::int32_t>(span.end) : 0;
  }
}

/// Calls visit(tile, blocks) for every tile that an extent reaches, row by row: the order of its slots.
template <class F>
inline void for_each_tile(const Extent& extent, const TileGrid& grid, const F& visit) {
  if (extent.row_begin >= extent.row_end) return;
  const std::int32_t across = static_cast<std::int32_t>(grid.tile / kBlockSide);
  const Index last_row = (extent.row_end - 1) / grid.tile;
  BandSpans spans;
  Index known = -1;  // the first row of tiles after those in `spans`
  for (Index r = extent.row_begin / grid.tile; r <= last_row; ++r) {
    const Index rows_together = kBands / across;
    if (r >= known) {
      band_spans(extent, grid, r * across, spans);
      known = r + rows_together;
    }
    const std::int32_t* const begin = spans.begin + (r + rows_together - known) * across;
    const std::int32_t* const end = spans.end + (r + rows_together - known) * across;
    std::int32_t first = begin[0], after = end[0];
    for (std::int32_t i = 1; i < across; ++i) first = std::min(first, begin[i]), after = std::max(after, end[i]);
    for (std::int32_t c = first / across; c * across < after; ++c) {
      std::uint32_t blocks = 0;
      for (std::int32_t i = 0; i < across; ++i) {
        const std::int32_t from = std::min(std::max(begin[i] - c * across, 0), across);
        const std::int32_t to = std::max(std::min(end[i] - c * across, across), from);
        blocks |= ((1u << to) - (1u << from)) << (i * across);
      }
      if (blocks != 0) visit(r * grid.cols + c, blocks);
    }
  }
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
  Buffer<Slots> slots;            ///< [N] of each Gaussian; none of those that are not in the order
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
  std::vector<std::vector<FoundPair>> found_;  // of each chunk of the order
  Buffer<std::uint32_t> counts_;               // [chunks][tiles]
  Buffer<std::uint32_t> groups_;               // [chunks][tiles]
};

}  // namespace hsi4d::detail
