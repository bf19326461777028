// The pairs of Gaussians and tiles, from extents. Used by tiles.h; not part of the public interface.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "splat/render/tiles.h"

namespace hsi4d::detail {

/// Where pairs of consecutive rows go.
struct PairSink {
  std::vector<FoundPair>& found;  ///< grows
  std::uint64_t* totals;    ///< [count_room(grid)] of each tile: pairs, and in the upper half groups; are added to
  TileLists::Slots* slots;  ///< of each row: its pairs in `found`
};

/// Numbers of PairSink::totals: tiles, and what stays 0 after them.
inline Index count_room(const TileGrid& grid) { return grid.count() + 4 * grid.cols + 16; }

/// Finds the pairs of rows, in the order of for_each_tile. Returns how many; keeps `most` of them or somewhat more.
Index find_pairs(std::span<const Extent> extents, const TileGrid& grid, Index most, const PairSink& sink);

}  // namespace hsi4d::detail
