// The static layer: what a render with Gaussians that stand still and Gaussians that move does once for all iterations.
// Used by composite.h; not part of the public interface.
//
// In a tile, those that stand still are in front of all that moves there, among it, or behind it. With the depths of
// what moves rounded outward to a fixed grid, this cut depends on the grid's steps alone, not on how they were come by.
//
//   front    is composited once into T and channels per pixel; compositing what follows over these gives the same bits
//   among    is merged with what moves in every iteration
//   behind   is composited in every iteration, in blocks that are not opaque yet, into channels of its own: what is
//            seen behind, relative to T there, is all that the adjoint needs of it
//
// so that the adjoint visits neither front nor behind.
#pragma once

#include <span>

#include "core/buffer.h"
#include "splat/render/block_kernel.h"
#include "splat/render/splat_lists.h"

namespace hsi4d::detail {

/// Steps of the depth's grid to an octave.
inline constexpr int kDepthSteps = 16;

/// Depths 2^(near/kDepthSteps) to 2^(far/kDepthSteps) metres.
struct DepthRange {
  std::int32_t near = 0, far = 0;
  bool operator==(const DepthRange&) const = default;
};

/// What is kept of a tile.
struct TileLayer {
  DepthRange range;
  bool made = false;
  Index first = 0, after = 0;  ///< list positions of those among what moves
  Buffer<float> front;         ///< state behind those in front
  PackedBlocks behind;         ///< those behind
  Buffer<float> seen;          ///< of the last forward run: what is seen behind, relative to T there

  Index capacity_bytes() const { return front.capacity_bytes() + behind.capacity_bytes() + seen.capacity_bytes(); }
};

/// Finds the range of what moves in a tile and, when it is not the layer's, the cut; the layer has to be made then.
///
/// @param still, moving  of the tile, in depth order; not empty
void place_layer(const SplatRows<float>& rows, const RenderSettings& settings, std::span<const TileEntry> still,
                 std::span<const TileEntry> moving, TileLayer& layer);

/// Merges two lists that are in depth order; those of `still` get no slot.
template <class S>
void merge_entries(const SplatRows<S>& rows, const RenderSettings& settings, std::span<const TileEntry> still,
                   std::span<const TileEntry> moving, TileEntry* merged);

/// Composites what stands still in front of a range, into layer.front; packs what is behind. Returns the fragments.
///
/// @param job  of the tile; its entries, blocks and state are not read
Index make_layer(Index side, const CompositeScene<float>& scene, BlockJob job, std::span<const TileEntry> still,
                 TileLayer& layer);

/// Composites what stands still behind over job.state, for job.blocks, and keeps layer.seen. Returns the fragments.
///
/// @param behind  entries
/// @param memory  block_state numbers
Index composite_behind(Index side, const CompositeScene<float>& scene, const BlockJob& job,
                       std::span<const TileEntry> behind, float* memory, TileLayer& layer);

/// From d_T of a tile's pixels to S behind what moves: S = Σ g_k seen_k + d_T seen_T.
///
/// @param d_channels  [C][W][W]
/// @param behind      [W][W] in: d_T, out: S
void see_behind(Index side, Index channels, std::uint32_t blocks, const TileLayer& layer, const float* d_channels,
                float* behind);

}  // namespace hsi4d::detail
