// Pixels of a tile written into images, and their cotangents read. Used by composite.cpp.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstring>

#include "autodiff/array.h"
#include "core/parallel.h"
#include "splat/render/block_kernel.h"
#include "splat/render/composite_kernel.h"

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

/// The outputs of composite: channels, the first of which may lie over a background, and T.
template <class S>
struct OutputImages {
  Array<S> over;           ///< the first channels, to which T·background is added if there is one
  Array<S> rest;           ///< the channels after them; may be empty
  Array<S> transmittance;  ///< one plane
  const S* background;     ///< a number for each plane of `over`; null: none

  Index channels() const { return over.shape.planes + (rest ? rest.shape.planes : 0); }
  /// Pixel (y, x) of channel k.
  S* at(Index k, Index y, Index x) const {
    return k < over.shape.planes ? &over(k, y, x) : &rest(k - over.shape.planes, y, x);
  }
  /// The background of channel k; 0 where there is none.
  S behind(Index k) const { return background != nullptr && k < over.shape.planes ? background[k] : S(0); }

  /// Writes a row of some pixels of a channel.
  ///
  /// @param through  T of these pixels
  void put(Index k, const S* from, const S* through, Index n, S* to) const {
    const S color = behind(k);
    if (color == S(0)) return copy_row(from, n, to);
    for (Index i = 0; i < n; ++i) to[i] = from[i] + through[i] * color;
  }
};

/// Cotangents of OutputImages; those that nothing asked for are empty.
template <class S>
struct OutputCotangents {
  ConstArray<S> over, rest, transmittance;
};

/// Adjoint of writing a tile: d_channels and, after them, d_T of its pixels, zero past the image's border. A channel
/// over a background has d_T += background d_channel.
///
/// @param place       a job of the tile
/// @param d_channels  [1 + channels][side][side]
template <class S, class Job>
void load_cotangent(const OutputImages<S>& images, const OutputCotangents<S>& d, Index side, const Job& place,
                    S* d_channels) {
  const Index pixels = side * side, channels = images.channels(), over = images.over.shape.planes;
  S* const d_through = d_channels + channels * pixels;
  std::fill_n(d_channels, (channels + 1) * pixels, S(0));
  const auto load = [&](const ConstArray<S>& from, Index plane, S* to) {
    for (Index r = 0; from && r < place.height; ++r) {
      copy_row(&from(plane, place.top + r, place.left), place.width, to + r * side);
    }
  };
  load(d.transmittance, 0, d_through);
  for (Index k = 0; k < channels; ++k) {
    const S behind = images.behind(k);
    S* const to = d_channels + k * pixels;
    k < over ? load(d.over, k, to) : load(d.rest, k - over, to);
    for (Index i = 0; behind != S(0) && i < pixels; ++i) d_through[i] += behind * to[i];
  }
}

/// d_background_k += Σ T d_channel_k
template <class S>
void add_background_gradient(const OutputImages<S>& images, const OutputCotangents<S>& d, S* d_background) {
  constexpr Index kRows = 16;  // of pixels, at a time
  const ConstArray<S> g = d.over;
  for (Index k = 0; g && k < g.shape.planes; ++k) {
    const double sum = parallel_sum(g.shape.rows, kRows, [&](Index begin, Index end) {
      double part = 0;
      for (Index r = begin; r < end; ++r) {
        const S *row = &g(k, r, 0), *through = images.transmittance.row(r);
        for (Index x = 0; x < g.shape.cols; ++x) part += static_cast<double>(through[x]) * static_cast<double>(row[x]);
      }
      return part;
    });
    d_background[k] += static_cast<S>(sum);
  }
}

/// Writes what the plain kernel composited.
template <class S>
void store_tile(Index side, const TileJob<S>& job, const OutputImages<S>& images) {
  for (Index r = 0; r < job.height; ++r) {
    const S* const through = job.transmittance + r * side;
    copy_row(through, job.width, &images.transmittance(job.top + r, job.left));
    for (Index k = 0; k < images.channels(); ++k) {
      images.put(k, job.channels + (k * side + r) * side, through, job.width, images.at(k, job.top + r, job.left));
    }
  }
}

/// Fetches the rows of the image that store_blocks will write.
inline void fetch_blocks(const BlockJob& job, const OutputImages<float>& images) {
  for (Index y = job.top; y < job.top + job.height; ++y) {
    __builtin_prefetch(&images.transmittance(0, y, job.left), 1);
    for (Index k = 0; k < images.channels(); ++k) __builtin_prefetch(images.at(k, y, job.left), 1);
  }
}

/// Writes a row of neighbouring blocks whole.
///
/// @param kAcross  blocks
/// @param state    of the first
/// @param top      of them in the image
template <Index kAcross>
inline void store_band(const float* state, Index left, Index top, const OutputImages<float>& images) {
  constexpr Index kSide = kBlockSide, kWidth = kAcross * kSide;
  const Index planes = images.channels(), size = (1 + planes) * kBlockPixels;
  float through[kSide][kWidth], row[kWidth];
  for (Index r = 0; r < kSide; ++r) {
    for (Index b = 0; b < kAcross; ++b) {
      for (Index i = 0; i < kSide; ++i) through[r][b * kSide + i] = std::abs(state[b * size + r * kSide + i]);
    }
    copy_row(through[r], kWidth, &images.transmittance(0, top + r, left));
  }
  for (Index k = 0; k < planes; ++k) {
    const float* const from = state + (k + 1) * kBlockPixels;
    for (Index r = 0; r < kSide; ++r) {
      for (Index b = 0; b < kAcross; ++b) {
        std::memcpy(row + b * kSide, from + b * size + r * kSide, kSide * sizeof(float));
      }
      images.put(k, row, through[r], kWidth, images.at(k, top + r, left));
    }
  }
}

/// Writes the pixels of a block that lie in the image.
inline void store_block(const float* state, Index left, Index top, Index width, Index height,
                        const OutputImages<float>& images) {
  constexpr Index kSide = kBlockSide;
  float through[kSide];
  for (Index r = 0; r < height; ++r) {
    for (Index i = 0; i < width; ++i) through[i] = std::abs(state[r * kSide + i]);
    std::copy_n(through, width, &images.transmittance(0, top + r, left));
    for (Index k = 0; k < images.channels(); ++k) {
      images.put(k, state + (k + 1) * kBlockPixels + r * kSide, through, width, images.at(k, top + r, left));
    }
  }
}

/// Writes the blocks that a job composited.
inline void store_blocks(Index side, const BlockJob& job, const OutputImages<float>& images) {
  constexpr Index kSide = kBlockSide;
  const Index across = side / kSide, size = (1 + images.channels()) * kBlockPixels;
  const std::uint32_t whole = (1u << across) - 1;
  for (Index y = 0; y < job.height; y += kSide) {
    const std::uint32_t blocks = job.blocks >> (y / kSide * across) & whole;
    const float* const state = job.state + y / kSide * across * size;
    if (blocks == whole && across == 4 && job.width == side && y + kSide <= job.height) {
      store_band<4>(state, job.left, job.top + y, images);
      continue;
    }
    for (Index x = 0; x < job.width; x += kSide) {
      if ((blocks >> (x / kSide) & 1u) == 0) continue;
      store_block(state + x / kSide * size, job.left + x, job.top + y, std::min(kSide, job.width - x),
                  std::min(kSide, job.height - y), images);
    }
  }
}

}  // namespace hsi4d::detail
