// Pixels of a tile written into images. Used by composite.cpp.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstring>

#include "autodiff/array.h"
#include "splat/block_kernel.h"

namespace hsi4d::detail {

/// Copies a row of a tile; nearly all are 16 pixels, and known lengths copy faster.
template <class S>
inline void copy_row(const S* from, Index n, S* to) {
  if (n == 16) {
    std::memcpy(to, from, 16 * sizeof(S));
  } else {
    std::copy_n(from, n, to);
  }
}

/// Fetches the rows of the image that store_blocks will write.
inline void fetch_blocks(const BlockJob& job, const Array<float>& channels, const Array<float>& transmittance) {
  for (Index y = job.top; y < job.top + job.height; ++y) {
    __builtin_prefetch(&transmittance(0, y, job.left), 1);
    for (Index k = 0; k < channels.shape.planes; ++k) __builtin_prefetch(&channels(k, y, job.left), 1);
  }
}

/// Writes a row of neighbouring blocks whole.
///
/// @param kAcross  blocks
/// @param state    of the first
/// @param top      of them in the image
template <Index kAcross>
inline void store_band(const float* state, Index left, Index top, const Array<float>& channels,
                       const Array<float>& transmittance) {
  constexpr Index kSide = kBlockSide;
  const Index planes = channels.shape.planes, size = (1 + planes) * kBlockPixels;
  for (Index r = 0; r < kSide; ++r) {
    float* const to = &transmittance(0, top + r, left);
    for (Index b = 0; b < kAcross; ++b) {
      for (Index i = 0; i < kSide; ++i) to[b * kSide + i] = std::abs(state[b * size + r * kSide + i]);
    }
  }
  for (Index k = 0; k < planes; ++k) {
    const float* const from = state + (k + 1) * kBlockPixels;
    for (Index r = 0; r < kSide; ++r) {
      float* const to = &channels(k, top + r, left);
      for (Index b = 0; b < kAcross; ++b) {
        std::memcpy(to + b * kSide, from + b * size + r * kSide, kSide * sizeof(float));
      }
    }
  }
}

/// Writes the pixels of a block that lie in the image.
inline void store_block(const float* state, Index left, Index top, Index width, Index height,
                        const Array<float>& channels, const Array<float>& transmittance) {
  constexpr Index kSide = kBlockSide;
  for (Index r = 0; r < height; ++r) {
    for (Index i = 0; i < width; ++i) transmittance(0, top + r, left + i) = std::abs(state[r * kSide + i]);
    for (Index k = 0; k < channels.shape.planes; ++k) {
      std::copy_n(state + (k + 1) * kBlockPixels + r * kSide, width, &channels(k, top + r, left));
    }
  }
}

/// Writes the blocks that a job composited.
inline void store_blocks(Index side, const BlockJob& job, const Array<float>& channels,
                         const Array<float>& transmittance) {
  constexpr Index kSide = kBlockSide;
  const Index across = side / kSide, size = (1 + channels.shape.planes) * kBlockPixels;
  const std::uint32_t whole = (1u << across) - 1;
  for (Index y = 0; y < job.height; y += kSide) {
    const std::uint32_t blocks = job.blocks >> (y / kSide * across) & whole;
    const float* const state = job.state + y / kSide * across * size;
    if (blocks == whole && across == 4 && job.width == side && y + kSide <= job.height) {
      store_band<4>(state, job.left, job.top + y, channels, transmittance);
      continue;
    }
    for (Index x = 0; x < job.width; x += kSide) {
      if ((blocks >> (x / kSide) & 1u) == 0) continue;
      store_block(state + x / kSide * size, job.left + x, job.top + y, std::min(kSide, job.width - x),
                  std::min(kSide, job.height - y), channels, transmittance);
    }
  }
}

}  // namespace hsi4d::detail
