// The pixel loops of composite.h for one tile, forward and backward, in vectors. Not part of the public interface.
#pragma once

#include <cstdint>
#include <span>
#include <type_traits>

#include "core/types.h"
#include "splat/render/splat_records.h"

namespace hsi4d::detail {

/// Gaussians, features and lists of an image.
template <class S>
struct CompositeScene {
  std::span<const SplatRecord<S>> records;  ///< in the order of the inputs
  const S* features[2];                     ///< [·,channels] of rows before `second`, and from there
  Index second;
  Index channels;
  CompositeRules<S> rules;
  const S* feature(Index n) const {
    return n < second ? features[0] + n * channels : features[1] + (n - second) * channels;
  }
};

/// A list position, as wide as S so that vectors of both have equally many lanes.
template <class S>
using ListPosition = std::conditional_t<sizeof(S) == 4, std::int32_t, std::int64_t>;

/// One tile of W×W pixels and its list. Numbers of its pixels are kept as [W][W], also past the image's border, and
/// aligned to kAlignment.
template <class S>
struct TileJob {
  std::span<const TileEntry> entries;
  Index left, top, width, height;  ///< pixels of the image; width, height ≤ W
  S* transmittance;                ///< [W][W]
  ListPosition<S>* last;           ///< [W][W] list position after the last Gaussian composited; 0: none
  S* channels;                     ///< [C][W][W]
  S* checkpoints;                  ///< T at list positions kSegment, 2 kSegment, … [·][W][W]; may be null
};

/// List positions whose T and G the backward pass holds at a time.
inline constexpr Index kSegment = 64;

/// Sums over the pixels of a (tile, Gaussian) pair, with g the gate times v_α G: Σ g, Σ g u, Σ g w, Σ g u², Σ g u w,
/// Σ g w²; the gradients of the features follow.
inline constexpr Index kMoments = 6;

/// What the backward pass of a tile reads and writes beside the job.
template <class S>
struct TileAdjoint {
  const S* d_channels;  ///< [C][W][W], zero past the border
  S* behind;            ///< [W][W] in: d_T; used up
  S* segment;           ///< workspace, 2 kSegment W²
  S* feature_sums;      ///< workspace, C W
  S* sums;              ///< of slot s at s · stride
  Index stride;
  bool wants_shape;     ///< moments first in a slot
  bool wants_features;  ///< then channels
};

/// Composites a tile: T, last, channels and checkpoints of the job. Returns the number of fragments.
///
/// @param side  W, 8 or 16
template <class S>
Index composite_tile(Index side, const CompositeScene<S>& scene, const TileJob<S>& job);

/// Adjoint of composite_tile: the sums of every pair of the tile's list up to the last one composited in any pixel;
/// the slots of those after it are left alone.
template <class S>
void composite_tile_adjoint(Index side, const CompositeScene<S>& scene, const TileJob<S>& job,
                            const TileAdjoint<S>& adjoint);

/// α at a pixel of the tile and whether it is composited there, stop aside, by the same functions.
template <class S>
struct PixelAlpha {
  S alpha;
  bool drawn, capped;
};
template <class S>
PixelAlpha<S> pixel_alpha(const SplatRecord<S>& record, const CompositeRules<S>& rules, const TileJob<S>& job,
                          Index row, Index col);

}  // namespace hsi4d::detail
