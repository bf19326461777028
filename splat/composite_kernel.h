// The pixel loops of composite.h, forward and backward, for one tile. Not part of the public interface.
//
// A tile is W×W pixels, W = 8 or 16, in rows; every loop over a row is plain code of fixed length that the compiler
// turns into vectors. Forward and backward compute G and α by the same two functions (row B13).
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>

#include "core/types.h"
#include "core/vector_exp.h"
#include "splat/tiles.h"

namespace hsi4d::detail {

/// What the pixel loops need of a Gaussian.
template <class S>
struct SplatRecord {
  S x, y;           ///< mean, pixels
  S l11, l21, l22;  ///< see Conic
  S opacity;        ///< with the antialias factor
  std::int32_t row_begin, row_end;  ///< pixels
  std::int32_t index;               ///< row of the inputs
};

/// Settings as the pixel loops use them.
template <class S>
struct CompositeRules {
  S alpha_cap, alpha_min;
  S stop_below;    ///< a pixel is finished when T is below this; 0: never
  bool exclusive;  ///< the Gaussian that would finish the pixel is left out
  bool pass_cap;   ///< the gradient passes where the cap holds
};

/// Gaussians, features and lists of an image.
template <class S>
struct CompositeScene {
  std::span<const SplatRecord<S>> records;  ///< in depth order
  const S* features;                        ///< [N,channels]
  Index channels;
  CompositeRules<S> rules;
};

/// One tile and its list. Numbers of its pixels are kept as [W][W], also past the image's border.
template <class S>
struct TileJob {
  std::span<const TileEntry> entries;
  Index left, top, width, height;  ///< pixels of the image; width, height ≤ W
  S* transmittance;                ///< [W][W]
  std::int32_t* last;              ///< [W][W] list position after the last Gaussian composited; 0: none
  S* channels;                     ///< [C][W][W]
  S* checkpoints;                  ///< T at list positions kSegment, 2 kSegment, … [·][W][W]; may be null
};

/// List positions whose T and G the backward pass holds at a time.
inline constexpr Index kSegment = 64;

/// u, and G = exp(−½(u² + w²)), at the pixel centres (first + c, y + dy) of a row.
template <int W, class S>
[[gnu::always_inline]] inline void row_gaussian(const SplatRecord<S>& r, S first, S dy, S* __restrict u,
                                                S* __restrict g) {
  const S w = r.l22 * dy, shift = r.l21 * dy, ww = w * w;
  for (int c = 0; c < W; ++c) {
    const S dx = (first + static_cast<S>(c)) - r.x;
    u[c] = r.l11 * dx + shift;
    g[c] = vector_exp(S(-0.5) * (u[c] * u[c] + ww));
  }
}

/// min(cap, o G); NaN stays NaN, and then fails every comparison.
template <class S>
[[gnu::always_inline]] inline S capped(S raw, S cap) {
  return raw > cap ? cap : raw;
}

/// First and last row of the tile that a Gaussian may touch.
template <class S>
struct TileRows {
  Index begin, end;
  TileRows(const SplatRecord<S>& r, const TileJob<S>& job)
      : begin(std::max<Index>(r.row_begin - job.top, 0)), end(std::min<Index>(r.row_end - job.top, job.height)) {}
};

/// Composites a tile: T, last, channels and checkpoints of the job. Returns the number of fragments.
template <int W, int kChannels, bool kExclusive, class S>
[[gnu::always_inline]] inline Index composite_tile(const CompositeScene<S>& scene, const TileJob<S>& job) {
  constexpr int kPixels = W * W;
  constexpr Index kLookEvery = 8;  // Gaussians between two looks at which rows are finished
  const Index channels = kChannels > 0 ? kChannels : scene.channels;
  const CompositeRules<S> rules = scene.rules;
  S* __restrict const t = job.transmittance;
  std::int32_t* __restrict const last = job.last;
  S* __restrict const out = job.channels;
  alignas(kAlignment) S alive[kPixels];
  alignas(kAlignment) std::int32_t count[W] = {};
  bool row_alive[W];
  for (int p = 0; p < kPixels; ++p) {
    t[p] = 1;
    last[p] = 0;
    alive[p] = p / W < job.height && p % W < job.width ? S(1) : S(0);
  }
  for (int r = 0; r < W; ++r) row_alive[r] = r < job.height;
  std::fill_n(out, channels * kPixels, S(0));
  const S first = static_cast<S>(job.left) + S(0.5);

  const Index size = static_cast<Index>(job.entries.size());
  for (Index at = 0; at < size; ++at) {
    if (at % kSegment == 0 && at > 0 && job.checkpoints != nullptr) {
      std::copy_n(t, kPixels, job.checkpoints + (at / kSegment - 1) * kPixels);
    }
    if (at % kLookEvery == 0 && at > 0) {
      bool any = false;
      for (Index r = 0; r < job.height; ++r) {
        S sum = 0;
        for (int c = 0; c < W; ++c) sum += alive[r * W + c];
        row_alive[r] = sum > S(0);
        any |= row_alive[r];
      }
      if (!any) break;
    }
    const SplatRecord<S>& record = scene.records[static_cast<std::size_t>(job.entries[static_cast<std::size_t>(at)].rank)];
    const S* const feature = scene.features + record.index * scene.channels;
    const TileRows<S> rows(record, job);
    const std::int32_t position = static_cast<std::int32_t>(at) + 1;
    for (Index r = rows.begin; r < rows.end; ++r) {
      if (!row_alive[r]) continue;
      alignas(kAlignment) S u[W], g[W], weight[W];
      row_gaussian<W>(record, first, (static_cast<S>(job.top + r) + S(0.5)) - record.y, u, g);
      S* __restrict const row_t = t + r * W;
      S* __restrict const row_live = alive + r * W;
      std::int32_t* __restrict const row_last = last + r * W;
      for (int c = 0; c < W; ++c) {
        const S alpha = capped(record.opacity * g[c], rules.alpha_cap);
        const bool met = (alpha >= rules.alpha_min) & (row_live[c] > S(0));
        S a = met ? alpha : S(0);
        const S next = row_t[c] * (S(1) - a);
        const bool past = next < rules.stop_below;
        if constexpr (kExclusive) {
          a = past ? S(0) : a;
          weight[c] = row_t[c] * a;
          row_t[c] = past ? row_t[c] : next;
          row_last[c] = met & !past ? position : row_last[c];
        } else {
          weight[c] = row_t[c] * a;
          row_t[c] = next;
          row_last[c] = met ? position : row_last[c];
        }
        row_live[c] = past ? S(0) : row_live[c];
        count[c] += a > S(0) ? 1 : 0;
      }
      for (Index k = 0; k < channels; ++k) {
        const S f = feature[k];
        S* __restrict const row_out = out + k * kPixels + r * W;
        for (int c = 0; c < W; ++c) row_out[c] += weight[c] * f;
      }
    }
  }
  Index fragments = 0;
  for (const std::int32_t n : count) fragments += n;
  return fragments;
}

/// Sums over the pixels of a (tile, Gaussian) pair, with g the gate times v_α G: Σ g, Σ g u, Σ g w, Σ g u², Σ g u w,
/// Σ g w²; the gradients of the features follow.
inline constexpr Index kMoments = 6;

/// What the backward pass of a tile reads and writes beside the job.
template <class S>
struct TileAdjoint {
  const S* d_channels;  ///< [C][W][W], zero past the border
  S* behind;            ///< [W][W] in: d_T; used up
  S* segment;           ///< workspace, 2 kSegment W²
  S* sums;              ///< of slot s at s · stride
  Index stride;
  bool wants_shape;     ///< moments first in a slot
  bool wants_features;  ///< then channels
};

/// Adds the columns of x in a fixed order: a tree.
template <int W, class S>
[[gnu::always_inline]] inline S row_sum(S* x) {
  for (int half = W / 2; half > 0; half /= 2) {
    for (int c = 0; c < half; ++c) x[c] += x[c + half];
  }
  return x[0];
}

/// T in front of each Gaussian of list positions [begin, end), and its G: 0 where it was not composited.
template <int W, class S>
[[gnu::always_inline]] inline void replay_segment(const CompositeScene<S>& scene, const TileJob<S>& job, Index begin,
                                                  Index end, S* __restrict segment) {
  constexpr int kPixels = W * W;
  const CompositeRules<S> rules = scene.rules;
  const std::int32_t* __restrict const last = job.last;
  const S first = static_cast<S>(job.left) + S(0.5);
  alignas(kAlignment) S t[kPixels];
  if (begin == 0) {
    std::fill_n(t, kPixels, S(1));
  } else {
    std::copy_n(job.checkpoints + (begin / kSegment - 1) * kPixels, kPixels, t);
  }
  for (Index at = begin; at < end; ++at) {
    const SplatRecord<S>& record = scene.records[static_cast<std::size_t>(job.entries[static_cast<std::size_t>(at)].rank)];
    const TileRows<S> rows(record, job);
    const std::int32_t position = static_cast<std::int32_t>(at);
    S* const of_entry = segment + (at - begin) * 2 * kPixels;
    for (Index r = rows.begin; r < rows.end; ++r) {
      alignas(kAlignment) S u[W], g[W];
      row_gaussian<W>(record, first, (static_cast<S>(job.top + r) + S(0.5)) - record.y, u, g);
      S* __restrict const kept_t = of_entry + r * W;
      S* __restrict const kept_g = of_entry + kPixels + r * W;
      S* __restrict const row_t = t + r * W;
      const std::int32_t* __restrict const row_last = last + r * W;
      for (int c = 0; c < W; ++c) {
        const S alpha = capped(record.opacity * g[c], rules.alpha_cap);
        const bool met = (alpha >= rules.alpha_min) & (position < row_last[c]);
        kept_t[c] = row_t[c];
        kept_g[c] = met ? g[c] : S(0);
        row_t[c] *= S(1) - (met ? alpha : S(0));
      }
    }
  }
}

/// Gradients of one (tile, Gaussian) pair, and `behind` moved to in front of it.
template <int W, int kChannels, class S>
[[gnu::always_inline]] inline void adjoint_of_entry(const CompositeScene<S>& scene, const TileJob<S>& job,
                                                    const TileAdjoint<S>& adjoint, const SplatRecord<S>& record,
                                                    const S* of_entry, S* __restrict sums, S* __restrict feature_sums) {
  constexpr int kPixels = W * W;
  const Index channels = kChannels > 0 ? kChannels : scene.channels;
  const CompositeRules<S> rules = scene.rules;
  const S* const feature = scene.features + record.index * scene.channels;
  const S first = static_cast<S>(job.left) + S(0.5);
  const TileRows<S> rows(record, job);
  alignas(kAlignment) S moments[kMoments][W] = {};
  std::fill_n(feature_sums, channels * W, S(0));
  const S held_gradient = rules.pass_cap ? S(1) : S(0);
  for (Index r = rows.begin; r < rows.end; ++r) {
    const S dy = (static_cast<S>(job.top + r) + S(0.5)) - record.y;
    const S w = record.l22 * dy, shift = record.l21 * dy;
    const S* __restrict const t = of_entry + r * W;
    const S* __restrict const g = of_entry + kPixels + r * W;
    const S* __restrict const d_row = adjoint.d_channels + r * W;
    S* __restrict const behind = adjoint.behind + r * W;
    alignas(kAlignment) S shown[W], vg[W], weight[W];  // cotangent · features, gate times v_α G, T α
    for (int c = 0; c < W; ++c) shown[c] = d_row[c] * feature[0];
    for (Index k = 1; k < channels; ++k) {
      const S f = feature[k];
      for (int c = 0; c < W; ++c) shown[c] += d_row[k * kPixels + c] * f;
    }
    for (int c = 0; c < W; ++c) {
      const S raw = record.opacity * g[c];
      const S a = capped(raw, rules.alpha_cap);
      vg[c] = t[c] * (shown[c] - behind[c]) * g[c] * (raw > rules.alpha_cap ? held_gradient : S(1));
      behind[c] = a * shown[c] + (S(1) - a) * behind[c];
      weight[c] = t[c] * a;
    }
    for (int c = 0; c < W && adjoint.wants_shape; ++c) {
      const S u = record.l11 * ((first + static_cast<S>(c)) - record.x) + shift;
      const S vgu = vg[c] * u, vgw = vg[c] * w;
      moments[0][c] += vg[c];
      moments[1][c] += vgu;
      moments[2][c] += vgw;
      moments[3][c] += vgu * u;
      moments[4][c] += vgu * w;
      moments[5][c] += vgw * w;
    }
    if (!adjoint.wants_features) continue;
    for (Index k = 0; k < channels; ++k) {
      S* __restrict const sum = feature_sums + k * W;
      for (int c = 0; c < W; ++c) sum[c] += weight[c] * d_row[k * kPixels + c];
    }
  }
  if (adjoint.wants_shape) {
    for (Index m = 0; m < kMoments; ++m) *sums++ = row_sum<W>(moments[m]);
  }
  if (adjoint.wants_features) {
    for (Index k = 0; k < channels; ++k) *sums++ = row_sum<W>(feature_sums + k * W);
  }
}

/// Adjoint of composite_tile: the sums of every pair of the tile's list, of those after the stop too (zeros).
///
/// @param feature_sums  workspace, [C][W]
template <int W, int kChannels, class S>
[[gnu::always_inline]] inline void composite_tile_adjoint(const CompositeScene<S>& scene, const TileJob<S>& job,
                                                          const TileAdjoint<S>& adjoint, S* feature_sums) {
  constexpr int kPixels = W * W;
  Index end = 0;
  for (int p = 0; p < kPixels; ++p) end = std::max<Index>(end, job.last[p]);
  const auto slot_of = [&](Index at) {
    return adjoint.sums + static_cast<Index>(job.entries[static_cast<std::size_t>(at)].slot) * adjoint.stride;
  };
  for (Index at = end; at < static_cast<Index>(job.entries.size()); ++at) {
    std::fill_n(slot_of(at), adjoint.stride, S(0));
  }
  while (end > 0) {
    const Index begin = (end - 1) / kSegment * kSegment;
    replay_segment<W>(scene, job, begin, end, adjoint.segment);
    for (Index at = end - 1; at >= begin; --at) {
      const SplatRecord<S>& record =
          scene.records[static_cast<std::size_t>(job.entries[static_cast<std::size_t>(at)].rank)];
      adjoint_of_entry<W, kChannels>(scene, job, adjoint, record, adjoint.segment + (at - begin) * 2 * kPixels,
                                     slot_of(at), feature_sums);
    }
    end = begin;
  }
}

/// The two for a tile side of 8 or 16, on the best instruction set.
template <class S>
Index composite_tile(Index side, const CompositeScene<S>& scene, const TileJob<S>& job);
template <class S>
void composite_tile_adjoint(Index side, const CompositeScene<S>& scene, const TileJob<S>& job,
                            const TileAdjoint<S>& adjoint, S* feature_sums);

}  // namespace hsi4d::detail
