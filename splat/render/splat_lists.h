// Gaussians that are listed together: records, depth order, and the tiles' lists. Used by composite.h; not part of the
// public interface.
#pragma once

#include "core/buffer.h"
#include "splat/render/render_counters.h"
#include "splat/render/splat_records.h"

namespace hsi4d::detail {

/// The rows of two sets counted through: those that stand still first, then those that move.
template <class S>
struct SplatRows {
  SplatArrays<S> still, moving;
  Index second = 0;  ///< first row of `moving`
  Index count() const { return second + moving.rows(); }
  /// The set of a row, and its number there.
  const SplatArrays<S>& set_of(Index n) const { return n < second ? still : moving; }
  Index in_set(Index n) const { return n < second ? n : n - second; }

  std::uint64_t key(const RenderSettings& settings, Index n) const { return depth_key(set_of(n), settings, in_set(n)); }
};

/// Rows [first, first + count).
struct SplatLists {
  Index first = 0, count = 0;
  Index visible = 0;  ///< rows that reach some tile
  Buffer<Extent> extents;
  Buffer<DepthKeyed> keys, room;
  TileLists lists;  ///< entries name rows as they are counted through, slots are counted from `first`

  std::span<const TileEntry> of_tile(Index tile) const {
    if (count == 0) return {};
    const Index begin = lists.tile_begin[tile], end = lists.tile_begin[tile + 1];
    return {lists.entries.data() + begin, static_cast<std::size_t>(end - begin)};
  }
  Index capacity_bytes() const {
    return extents.capacity_bytes() + keys.capacity_bytes() + room.capacity_bytes() + lists.capacity_bytes();
  }
};

/// Makes the records and lists of rows [first, first + count). Throws as TileLists::find and check_pair_memory.
///
/// @param records         [rows] those of the rows listed are written
/// @param bytes_per_pair  that the caller will take
/// @param times           of its steps; they are assigned
template <class S>
void list_splats(const SplatRows<S>& rows, Index first, Index count, const RenderSettings& settings,
                 const TileGrid& tiles, std::span<SplatRecord<S>> records, double bytes_per_pair, SplatLists& result,
                 RenderTimes& times);

}  // namespace hsi4d::detail
