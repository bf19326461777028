// What a render did: counts and times.
#pragma once

#include "core/types.h"

namespace hsi4d {

/// Seconds of the steps of the last forward and backward runs; records to bin of what is not kept from an earlier run.
struct RenderTimes {
  double still_s = 0;  ///< records, order and lists of the Gaussians that stand still; 0 when they were kept
  double records_s = 0, sort_s = 0, bin_s = 0, forward_s = 0, backward_s = 0, reduce_s = 0;

  RenderTimes& operator+=(const RenderTimes& other);
};

/// What the last runs did.
struct RenderCounters {
  Index channels = 0;       ///< that were composited: three of colour, and what else was asked for
  Index gaussians = 0;      ///< that the render was given
  Index visible = 0;        ///< Gaussians that reach a tile
  Index pairs = 0;          ///< (tile, Gaussian) that were looked at
  Index groups = 0;         ///< (block of 4×4 pixels, Gaussian) that may touch, of those with an adjoint or among them
  Index fragments = 0;      ///< (pixel, Gaussian) that were composited
  Index tiles = 0;          ///< tiles of which something was composited
  Index reached = 0;        ///< pairs up to the last one of each tile that is composited: those that have an adjoint
  Index layers = 0;         ///< tiles whose static layer was made anew
  Index dirty_tiles = 0;    ///< of kMaskSquare² pixels that losses read again; 0: all
  Index adjoint_tiles = 0;  ///< tiles that the backward run visited
  Index kept_bytes = 0;     ///< of the pixels, from forward to backward, beside the outputs
  RenderTimes times;

  /// Adds what other runs did.
  RenderCounters& operator+=(const RenderCounters& other);
};

inline RenderTimes& RenderTimes::operator+=(const RenderTimes& other) {
  for (const auto part : {&RenderTimes::still_s, &RenderTimes::records_s, &RenderTimes::sort_s, &RenderTimes::bin_s,
                          &RenderTimes::forward_s, &RenderTimes::backward_s, &RenderTimes::reduce_s})
    this->*part += other.*part;
  return *this;
}

inline RenderCounters& RenderCounters::operator+=(const RenderCounters& other) {
  for (const auto count :
       {&RenderCounters::gaussians, &RenderCounters::visible, &RenderCounters::pairs, &RenderCounters::groups,
        &RenderCounters::fragments, &RenderCounters::tiles, &RenderCounters::reached, &RenderCounters::layers,
        &RenderCounters::dirty_tiles, &RenderCounters::adjoint_tiles, &RenderCounters::kept_bytes})
    this->*count += other.*count;
  times += other.times;
  return *this;
}

}  // namespace hsi4d
