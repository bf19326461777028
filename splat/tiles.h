// Which tiles a projected Gaussian reaches, and the lists of Gaussians of every tile, in depth order. Used by
// composite.h; not part of the public interface.
#pragma once

#include <cstdint>
#include <span>

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
};

/// The extent that settings ask for. It never leaves out a pixel where min(cap, o G) ≥ alpha_min, with room for the
/// rounding of arithmetic in which 1 + `epsilon` is the next number after 1 (row B7).
///
/// @param opacity  o, with the antialias factor
/// @param epsilon  of the precision that α is computed in
Extent extent_of(const Conic& conic, double x, double y, double opacity, const TileGrid& grid,
                 const RenderSettings& settings, double epsilon);

/// Columns of tiles that an extent reaches in one row of tiles.
TileSpan tile_columns(const Extent& extent, const TileGrid& grid, Index tile_row);

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
  std::int32_t rank;   ///< place in the depth order
  std::uint32_t slot;  ///< of this (tile, Gaussian) pair; those of a Gaussian follow each other
};

/// The sum of the numbers of pairs. Throws UserError if it is above kMostPairs (row B10).
Index total_pairs(std::span<const Index> pairs);

/// Most bytes that the pairs of an image may take: kPairMemoryShare of the machine's memory.
Index pair_memory_limit();

/// Throws UserError if `bytes` is above `limit` (row B10).
///
/// @param pairs  that ask for the bytes
void check_pair_memory(Index pairs, double bytes, Index limit);

/// Calls visit(tile) for every tile that an extent reaches, row by row: the order of its slots.
template <class F>
void for_each_tile(const Extent& extent, const TileGrid& grid, const F& visit) {
  if (extent.row_begin >= extent.row_end) return;
  for (Index r = extent.row_begin / grid.tile; r <= (extent.row_end - 1) / grid.tile; ++r) {
    const TileSpan span = tile_columns(extent, grid, r);
    for (Index c = span.begin; c < span.end; ++c) visit(r * grid.cols + c);
  }
}

/// The Gaussians of every tile.
struct TileLists {
  Buffer<Index> tile_begin;  ///< [tiles + 1] into entries
  Buffer<Index> slot_begin;  ///< [ranks + 1] slots of each Gaussian
  Buffer<TileEntry> entries;

  Index pairs() const { return entries.size(); }
  /// Counts the pairs for extents in depth order and places them: slot_begin and tile_begin. Takes no memory for pairs.
  /// Parallel; the result depends on the arguments alone. Throws as total_pairs.
  ///
  /// @param counts  workspace, handed on to fill
  void count(std::span<const Extent> extents, const TileGrid& grid, Buffer<Index>& counts);
  /// Fills the lists, after count with the same arguments.
  void fill(std::span<const Extent> extents, const TileGrid& grid, Buffer<Index>& counts);
};

}  // namespace hsi4d::detail
