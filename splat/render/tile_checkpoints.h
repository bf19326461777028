// What compositing forward keeps for its adjoint, tile by tile. Used by composite.cpp.
#pragma once

#include "core/buffer.h"
#include "splat/render/block_kernel.h"
#include "splat/render/composite_kernel.h"
#include "splat/render/tile_plans.h"

namespace hsi4d::detail {

/// Checkpoints of T, and where pixels or blocks stopped.
template <class S>
struct TileCheckpoints {
  Buffer<Index> checkpoint_begin = {};  ///< pieces of a tile's, or a block's, pixels
  Buffer<S> checkpoints = {};
  Buffer<ListPosition<S>> last = {};  ///< plain kernel
  Buffer<Index> run_begin = {};       ///< block kernel
  Buffer<BlockRun> runs = {};         ///< block kernel

  /// Makes room.
  /// @param in_blocks  for the block kernel, else for the plain one
  /// @param wanted     there will be an adjoint
  void place(const TilePlans& planned, const TileGrid& tiles, bool in_blocks, bool wanted) {
    const Index side = tiles.tile, across = side / kBlockSide;
    checkpoint_begin.resize(tiles.count() + 1);
    run_begin.resize(tiles.count() + 1);
    Index place = 0, run = 0;
    for (Index tile = 0; tile < tiles.count(); ++tile) {
      checkpoint_begin[tile] = place;
      run_begin[tile] = run;
      const auto size = static_cast<Index>(planned.plans[tile].entries.size());
      if (!wanted || size == 0) continue;
      place += in_blocks ? checkpoints_of(side, size, planned.plans[tile].groups) : (size - 1) / kSegment;
      run += block_chunks(size) * across * across;
    }
    checkpoint_begin[tiles.count()] = place;
    run_begin[tiles.count()] = run;
    checkpoints.resize(place * (in_blocks ? kBlockPixels : side * side));
    runs.resize(in_blocks ? run : 0);
    last.resize(in_blocks ? 0 : tiles.count() * side * side);
  }

  /// Gives a job of the plain kernel its part.
  void give(const TileGrid& tiles, Index tile, TileJob<S>& job) {
    const Index pixels = tiles.tile * tiles.tile;
    job.last = last.data() + tile * pixels;
    job.checkpoints = checkpoints.size() > 0 ? checkpoints.data() + checkpoint_begin[tile] * pixels : nullptr;
  }
  /// The same of the block kernel; none without an adjoint.
  void give(Index tile, BlockJob& job) {
    if (runs.size() == 0) return;
    job.runs = runs.data() + run_begin[tile];
    job.checkpoints = checkpoints.data() + checkpoint_begin[tile] * kBlockPixels;
  }

  /// Bytes that are in use.
  Index bytes() const {
    return checkpoints.size() * static_cast<Index>(sizeof(S)) + runs.size() * static_cast<Index>(sizeof(BlockRun)) +
           last.size() * static_cast<Index>(sizeof(ListPosition<S>));
  }
  Index capacity_bytes() const {
    return checkpoint_begin.capacity_bytes() + checkpoints.capacity_bytes() + last.capacity_bytes() +
           run_begin.capacity_bytes() + runs.capacity_bytes();
  }
};

}  // namespace hsi4d::detail
