// What the compositor in use does at one pixel with one Gaussian, by the functions that its kernels are made of.
#pragma once

#include <type_traits>

#include "splat/render/block_kernel.h"
#include "splat/render/composite_kernel.h"

namespace hsi4d::detail {

/// True: composite uses the block kernel for so many features; else the plain one.
template <class S>
constexpr bool composites_in_blocks(Index features) {
  return std::is_same_v<S, float> && features <= kMostBlockChannels;
}

/// α of a Gaussian at a pixel, and T behind it.
template <class S>
struct PixelOf {
  PixelAlpha<S> pixel;
  S behind;
};

/// @param side           of a tile
/// @param job            its place is used alone
/// @param row, col       in the tile
/// @param transmittance  in front of the Gaussian
template <class S>
PixelOf<S> pixel_of(bool in_blocks, Index side, const SplatRecord<S>& record, const CompositeRules<S>& rules,
                    const TileJob<S>& job, Index row, Index col, S transmittance) {
  if constexpr (std::is_same_v<S, float>) {
    if (in_blocks) {
      const PixelAlpha<S> pixel = block_pixel_alpha(side, record, rules, job.left, job.top, row, col);
      return {pixel, block_transmittance(transmittance, pixel.alpha)};
    }
  }
  const PixelAlpha<S> pixel = pixel_alpha(record, rules, job, row, col);
  return {pixel, transmittance * (S(1) - pixel.alpha)};
}

}  // namespace hsi4d::detail
