// The pixel loops of composite.h in float, in blocks of 4×4 pixels; forward and backward. Not part of the public
// interface.
//
// With L of the conic scaled by sqrt(½ log₂ e) and K = log₂ o,
//
//   u = l11 x + l21 y + u0,   w = l22 y + w0,   p = K − u² − w²,   α = 2ᵖ
//
// x, y from the tile's centre; u0 and w0, the mean's part, are made in double. p ≥ log₂ alpha_min decides what is cut.
#pragma once

#include <cstdint>
#include <span>

#include "core/buffer.h"
#include "splat/render/composite_kernel.h"

namespace hsi4d::detail {

/// Features that the block kernel composites at most.
inline constexpr Index kMostBlockChannels = 16;

/// List positions that are taken into a tile's workspace at a time.
inline constexpr Index kBlockChunk = 1024;
/// Positions of a block's list between two kept transmittances.
inline constexpr Index kBlockSegment = 64;

inline constexpr Index kBlockPixels = 16;

/// sqrt(½ log₂ e): what L is scaled by.
inline constexpr double kLog2Scale = 0.84932180028801904272;

/// What a block did with a chunk of the tile's list, for the backward pass.
struct BlockRun {
  std::int32_t end;         ///< positions of the block's list up to the last one composited in any pixel
  std::int32_t checkpoint;  ///< number of its first kept transmittance in the tile's
};

/// A list packed for the loops, to be composited many times; see pack_blocks. By chunks, each with room at its end.
struct PackedBlocks {
  static constexpr Index kRoom = 16;
  Buffer<float> splats;         ///< [entries + kRoom chunks][8]
  Buffer<float> features;       ///< [entries + kRoom chunks][C]
  Buffer<std::int32_t> blocks;  ///< [entries + kRoom chunks]
  bool near_cap = false;        ///< some α may reach the cap
  /// Place of a chunk's first entry.
  static Index begin(Index chunk) { return chunk * (kBlockChunk + kRoom); }
  Index capacity_bytes() const { return splats.capacity_bytes() + features.capacity_bytes() + blocks.capacity_bytes(); }
};

/// One tile and a list; see TileJob. What is known of a block's pixels is its state, [1 + C][16]: T, negative for
/// pixels that are finished or lie past the image's border, and channels.
struct BlockJob {
  std::span<const TileEntry> entries;
  const PackedBlocks* packed;  ///< of the entries; null: they are packed on the way; only forward
  Index left, top, width, height;
  std::uint32_t blocks;  ///< bit b: composite block b
  float* state;          ///< [blocks][1 + C][16], in and out; only forward
  const float* start;    ///< state in front of the list; null: that of begin_blocks; only backward
  BlockRun* runs;        ///< [chunks][blocks]; may be null in forward: nothing is kept
  float* checkpoints;    ///< [·][16], room for checkpoints_of(…)
  float* workspace;      ///< block_workspace(…) numbers, aligned
};

inline constexpr std::uint32_t all_blocks(Index side) {
  const Index count = (side / kBlockSide) * (side / kBlockSide);
  return (std::uint32_t(1) << count) - 1;
}

/// Numbers of a tile's state.
inline Index block_state(Index side, Index channels) { return (1 + channels) * side * side; }

/// The state in front of all Gaussians: T = 1 in the image, −1 past its border; channels 0.
void begin_blocks(Index side, Index width, Index height, Index channels, float* state);

/// What the backward pass of a tile reads and writes beside the job.
struct BlockAdjoint {
  const float* d_channels;  ///< [C][W][W], zero past the border
  const float* behind;      ///< [W][W] S behind the list: d_T where nothing follows; zero past the border
  float* sums;              ///< of slot s at s · stride: moments, then features, then padding; aligned
  Index stride;             ///< block_slot(C), or block_slot(0) without features
  bool wants_shape, wants_features;
};

/// What forward tells.
struct BlockCounts {
  Index fragments;
  Index end;  ///< list position after the last one composited in any pixel
};

inline Index block_chunks(Index entries) { return (entries + kBlockChunk - 1) / kBlockChunk; }

/// Room for kept transmittances of a tile, in blocks of kBlockPixels numbers.
///
/// @param groups  (block, Gaussian) pairs of the tile
inline Index checkpoints_of(Index side, Index entries, Index groups) {
  const Index blocks = (side / kBlockSide) * (side / kBlockSide);
  return groups / kBlockSegment + (entries > kBlockChunk ? (block_chunks(entries) - 1) * blocks : 0);
}

/// Numbers in the slot of a pair: moments and features, in fours.
inline Index block_slot(Index channels) { return (kMoments + channels + 3) / 4 * 4; }

/// Numbers of workspace that a tile takes.
Index block_workspace(Index channels);

/// Packs the entries of a job.
void pack_blocks(Index side, const CompositeScene<float>& scene, const BlockJob& job, PackedBlocks& packed);

/// Composites a list over the state of a tile's blocks.
///
/// @param side  W, 8 or 16
BlockCounts composite_blocks(Index side, const CompositeScene<float>& scene, const BlockJob& job);

/// Adjoint of composite_blocks: the sums of the pairs at list positions before the largest end, but for those whose
/// slot is kNoSlot. Moments are those of v = ∂/∂ log α: Σ v, Σ v u, Σ v w, Σ v u², Σ v u w, Σ v w², with u and w as
/// scaled above.
void composite_blocks_adjoint(Index side, const CompositeScene<float>& scene, const BlockJob& job,
                              const BlockAdjoint& adjoint);

/// α of a Gaussian at a pixel of the tile whose corner is (left, top) by the same functions, and whether it is
/// composited there, stop aside.
PixelAlpha<float> block_pixel_alpha(Index side, const SplatRecord<float>& record, const CompositeRules<float>& rules,
                                    Index left, Index top, Index row, Index col);

/// T behind a Gaussian, by the same function.
float block_transmittance(float transmittance, float alpha);

}  // namespace hsi4d::detail
