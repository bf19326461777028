// Vector code of compositing; the mathematics is in splat/render/composite.h.
//
// Pixels of a row are lanes. A Gaussian visits the rows of the tile that its extent meets; what depends on the row
// alone is computed once: u = l11 dx + (l21 dy), w = l22 dy. Forward and backward get G and α from the same two
// functions, so that they agree to the last bit on what is composited (row B13: two passes).
//
// The backward pass walks the list from the back in segments. A segment is first replayed from the front (T in front of
// each Gaussian, and G), starting from T that the forward pass kept: nothing is divided by 1 − α (row B2).
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "splat/render/composite_kernel.cpp"
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_SSE4 | HWY_AVX3_DL)
// clang-format off
#include <hwy/foreach_target.h>
// clang-format on
#include "splat/render/composite_kernel.h"

#include <algorithm>
#include <cstring>

#include <hwy/cache_control.h>
#include <hwy/highway.h>

#include "core/check.h"
#include "core/vector_exp.h"

HWY_BEFORE_NAMESPACE();
namespace hsi4d::detail::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// Lanes for rows of W pixels.
template <class S, int W>
using Tag = hn::CappedTag<S, static_cast<size_t>(W)>;

/// eˣ for x ≤ 0 by the method and numbers of core/vector_exp.h, within 2 ulp; 0 where the result would not be a normal
/// number, and for NaN.
template <class D, class V>
HWY_INLINE V exp_of_negative(D d, V x) {
  using S = hn::TFromD<D>;
  using N = ExpNumbers<S>;
  const hn::RebindToSigned<D> di;
  const V lowest = hn::Set(d, N::kIsFloat ? S(-87.25) : S(-708)), round = hn::Set(d, N::kRound);
  const V held = hn::Max(x, lowest);
  const V shifted = hn::MulAdd(held, hn::Set(d, N::kLog2E), round);
  const V n = hn::Sub(shifted, round);
  V r = hn::NegMulAdd(n, hn::Set(d, N::kLn2High), held);
  r = hn::NegMulAdd(n, hn::Set(d, N::kLn2Low), r);
  V y = hn::Set(d, N::kTaylor[0]);
  for (std::size_t k = 1; k < N::kTaylor.size(); ++k) y = hn::MulAdd(y, r, hn::Set(d, N::kTaylor[k]));
  for (int k = 0; k < 2; ++k) y = hn::MulAdd(y, r, hn::Set(d, S(1)));
  const auto power = hn::Sub(hn::BitCast(di, shifted), hn::BitCast(di, round));
  const V scale = hn::BitCast(d, hn::ShiftLeft<N::kMantissa>(hn::Add(power, hn::Set(di, N::kBias))));
  return hn::IfThenElseZero(hn::Ge(x, lowest), hn::Mul(y, scale));
}

/// A Gaussian's numbers, ready for lanes; its mean from the tile's corner.
template <class D>
struct Splat {
  using S = hn::TFromD<D>;
  using V = hn::Vec<D>;
  V x, l11, opacity;
  S y, l21, l22;

  HWY_INLINE Splat(D d, const TileJob<S>& job, const SplatRecord<S>& r)
      : x(hn::Set(d, static_cast<S>(r.x - static_cast<double>(job.left)))),
        l11(hn::Set(d, r.l11)),
        opacity(hn::Set(d, r.opacity)),
        y(static_cast<S>(r.y - static_cast<double>(job.top))),
        l21(r.l21),
        l22(r.l22) {}
};

/// What a row shares: −½ w², l21 dy, and w.
template <class D>
struct SplatRow {
  using V = hn::Vec<D>;
  V shift, half_square, w;

  template <class S>
  HWY_INLINE SplatRow(D d, const Splat<D>& g, S center_y) {
    const S dy = center_y - g.y, along = g.l22 * dy;
    shift = hn::Set(d, g.l21 * dy);
    w = hn::Set(d, along);
    half_square = hn::Set(d, S(-0.5) * along * along);
  }
};

template <class D, class V>
HWY_INLINE V u_of(D, const Splat<D>& g, const SplatRow<D>& row, V center_x) {
  return hn::MulAdd(g.l11, hn::Sub(center_x, g.x), row.shift);
}

/// G = exp(−½(u² + w²)); 0 where that is NaN, of a mean so far away that u is a difference of infinities.
template <class D, class V>
HWY_INLINE V gaussian_of(D d, const Splat<D>& g, const SplatRow<D>& row, V center_x) {
  const V u = u_of(d, g, row, center_x);
  return exp_of_negative(d, hn::MulAdd(hn::Mul(u, u), hn::Set(d, hn::TFromD<D>(-0.5)), row.half_square));
}

/// min(cap, o G).
template <class D, class V>
HWY_INLINE V alpha_of(D, const Splat<D>& g, V gaussian, V cap) {
  return hn::Min(hn::Mul(g.opacity, gaussian), cap);
}

/// Centres of the pixels of a row from column c, and of a row, from the tile's corner.
template <class D>
HWY_INLINE hn::Vec<D> centers(D d, Index c) {
  using S = hn::TFromD<D>;
  return hn::Iota(d, static_cast<S>(c) + S(0.5));
}

template <class S>
HWY_INLINE S center_y(Index r) {
  return static_cast<S>(r) + S(0.5);
}

/// Rows of the tile that a Gaussian may touch.
struct RowRange {
  Index begin, end;
  template <class S>
  HWY_INLINE RowRange(const SplatRecord<S>& r, const TileJob<S>& job)
      : begin(std::max<Index>(r.row_begin - job.top, 0)), end(std::min<Index>(r.row_end - job.top, job.height)) {}
};

template <class S>
HWY_INLINE const SplatRecord<S>& record_at(const CompositeScene<S>& scene, const TileJob<S>& job, Index at) {
  return scene.records[static_cast<size_t>(job.entries[static_cast<size_t>(at)].index)];
}

/// Fetches the record that will be looked at a few list positions later: they lie far apart.
template <class S>
HWY_INLINE void fetch_ahead(const CompositeScene<S>& scene, const TileJob<S>& job, Index at) {
  constexpr Index kAhead = 4;
  if (at + kAhead < static_cast<Index>(job.entries.size())) hwy::Prefetch(&record_at(scene, job, at + kAhead));
}

template <int W, class S>
HWY_INLINE bool any_alive(const S* alive_row) {
  bool any = false;
  for (int c = 0; c < W; ++c) any |= alive_row[c] > S(0);
  return any;
}

// --- forward ---------------------------------------------------------------------------------------------------------

template <int W, int kChannels, class S>
Index composite(const CompositeScene<S>& scene, const TileJob<S>& job) {
  const Tag<S, W> d;
  const hn::RebindToSigned<Tag<S, W>> di;
  using V = hn::Vec<Tag<S, W>>;
  constexpr int kPixels = W * W;
  const Index lanes = static_cast<Index>(hn::Lanes(d));
  const Index channels = kChannels > 0 ? kChannels : scene.channels;
  const CompositeRules<S> rules = scene.rules;
  const V cap = hn::Set(d, rules.alpha_cap), least = hn::Set(d, rules.alpha_min), one = hn::Set(d, S(1));
  const V stop = hn::Set(d, rules.stop_below), zero = hn::Zero(d);
  S* const t = job.transmittance;
  HWY_ALIGN S alive[kPixels];
  bool row_alive[W];
  Index rows_alive = 0;
  for (int p = 0; p < kPixels; ++p) {
    t[p] = 1;
    job.last[p] = 0;
    alive[p] = p / W < job.height && p % W < job.width ? S(1) : S(0);
  }
  for (int r = 0; r < W; ++r) rows_alive += row_alive[r] = r < job.height;
  std::memset(job.channels, 0, static_cast<size_t>(channels * kPixels) * sizeof(S));

  Index fragments = 0;
  const Index size = static_cast<Index>(job.entries.size());
  for (Index at = 0; at < size && rows_alive > 0; ++at) {
    if (at % kSegment == 0 && at > 0 && job.checkpoints != nullptr) {
      std::memcpy(job.checkpoints + (at / kSegment - 1) * kPixels, t, kPixels * sizeof(S));
    }
    fetch_ahead(scene, job, at);
    const SplatRecord<S>& record = record_at(scene, job, at);
    const Splat<Tag<S, W>> splat(d, job, record);
    const S* const feature = scene.feature(job.entries[static_cast<size_t>(at)].index);
    const auto position = hn::Set(di, static_cast<ListPosition<S>>(at + 1));
    const RowRange rows(record, job);
    for (Index r = rows.begin; r < rows.end; ++r) {
      if (!row_alive[r]) continue;
      const SplatRow<Tag<S, W>> row(d, splat, center_y<S>(r));
      bool finished = false;
      for (Index c = 0; c < W; c += lanes) {
        const Index p = r * W + c;
        const V alpha = alpha_of(d, splat, gaussian_of(d, splat, row, centers(d, c)), cap);
        auto met = hn::And(hn::Ge(alpha, least), hn::Gt(hn::Load(d, alive + p), zero));
        if (hn::AllFalse(d, met)) continue;
        const V through = hn::Load(d, t + p);
        V next = hn::Mul(through, hn::Sub(one, alpha));
        const auto past = hn::And(met, hn::Lt(next, stop));
        if (!hn::AllFalse(d, past)) {
          hn::Store(hn::IfThenZeroElse(past, hn::Load(d, alive + p)), d, alive + p);
          if (rules.exclusive) met = hn::AndNot(past, met);
          finished = true;
        }
        const V a = hn::IfThenElseZero(met, alpha);
        const V weight = hn::Mul(through, a);
        hn::Store(hn::IfThenElse(met, next, through), d, t + p);
        const auto last = hn::Load(di, job.last + p);
        hn::Store(hn::IfThenElse(hn::RebindMask(di, met), position, last), di, job.last + p);
        fragments += static_cast<Index>(hn::CountTrue(d, hn::Gt(a, zero)));
        for (Index k = 0; k < channels; ++k) {
          S* const out = job.channels + k * kPixels + p;
          hn::Store(hn::MulAdd(weight, hn::Set(d, feature[k]), hn::Load(d, out)), d, out);
        }
      }
      if (!finished || any_alive<W>(alive + r * W)) continue;
      row_alive[r] = false;
      --rows_alive;
    }
  }
  return fragments;
}

// --- backward --------------------------------------------------------------------------------------------------------

/// T in front of each Gaussian of list positions [begin, end), and its G: 0 where it was not composited. T is left out
/// for vectors without a G.
template <int W, class S>
void replay(const CompositeScene<S>& scene, const TileJob<S>& job, Index begin, Index end, S* segment) {
  const Tag<S, W> d;
  const hn::RebindToSigned<Tag<S, W>> di;
  using V = hn::Vec<Tag<S, W>>;
  constexpr int kPixels = W * W;
  const Index lanes = static_cast<Index>(hn::Lanes(d));
  const V cap = hn::Set(d, scene.rules.alpha_cap), least = hn::Set(d, scene.rules.alpha_min), one = hn::Set(d, S(1));
  HWY_ALIGN S t[kPixels];
  if (begin == 0) {
    std::fill_n(t, kPixels, S(1));
  } else {
    std::memcpy(t, job.checkpoints + (begin / kSegment - 1) * kPixels, kPixels * sizeof(S));
  }
  for (Index at = begin; at < end; ++at) {
    fetch_ahead(scene, job, at);
    const SplatRecord<S>& record = record_at(scene, job, at);
    const Splat<Tag<S, W>> splat(d, job, record);
    const auto position = hn::Set(di, static_cast<ListPosition<S>>(at));
    S* const of_entry = segment + (at - begin) * 2 * kPixels;
    const RowRange rows(record, job);
    for (Index r = rows.begin; r < rows.end; ++r) {
      const SplatRow<Tag<S, W>> row(d, splat, center_y<S>(r));
      for (Index c = 0; c < W; c += lanes) {
        const Index p = r * W + c;
        const V gaussian = gaussian_of(d, splat, row, centers(d, c));
        const V alpha = alpha_of(d, splat, gaussian, cap);
        const auto in_list = hn::RebindMask(d, hn::Gt(hn::Load(di, job.last + p), position));
        const auto met = hn::And(hn::Ge(alpha, least), in_list);
        hn::Store(hn::IfThenElseZero(met, gaussian), d, of_entry + kPixels + p);
        if (hn::AllFalse(d, met)) continue;
        const V through = hn::Load(d, t + p);
        hn::Store(through, d, of_entry + p);
        hn::Store(hn::IfThenElse(met, hn::Mul(through, hn::Sub(one, alpha)), through), d, t + p);
      }
    }
  }
}

/// Gradients of one (tile, Gaussian) pair into its slot, if it has one, and `behind` moved to in front of the Gaussian.
template <int W, int kChannels, class S>
void adjoint_of_entry(const CompositeScene<S>& scene, const TileJob<S>& job, const TileAdjoint<S>& adjoint,
                      const TileEntry& entry, const S* of_entry) {
  const Tag<S, W> d;
  using V = hn::Vec<Tag<S, W>>;
  constexpr int kPixels = W * W;
  const Index lanes = static_cast<Index>(hn::Lanes(d));
  const Index channels = kChannels > 0 ? kChannels : scene.channels;
  const SplatRecord<S>& record = scene.records[static_cast<size_t>(entry.index)];
  const S* const feature = scene.feature(entry.index);
  const bool has_slot = entry.slot != kNoSlot;
  const bool wants_shape = adjoint.wants_shape && has_slot, wants_features = adjoint.wants_features && has_slot;
  const Splat<Tag<S, W>> splat(d, job, record);
  const V cap = hn::Set(d, scene.rules.alpha_cap), one = hn::Set(d, S(1)), zero = hn::Zero(d);
  const V held_gradient = hn::Set(d, scene.rules.pass_cap ? S(1) : S(0));
  V m0 = zero, m1 = zero, m2 = zero, m3 = zero, m4 = zero, m5 = zero;
  V f0 = zero, f1 = zero, f2 = zero;
  if (kChannels == 0) std::memset(adjoint.feature_sums, 0, static_cast<size_t>(channels * lanes) * sizeof(S));
  const RowRange rows(record, job);
  for (Index c = 0; c < W; c += lanes) {
    const V center_x = centers(d, c);
    for (Index r = rows.begin; r < rows.end; ++r) {
      const Index p = r * W + c;
      const V gaussian = hn::Load(d, of_entry + kPixels + p);
      if (hn::AllFalse(d, hn::Gt(gaussian, zero))) continue;
      const S* const d_row = adjoint.d_channels + p;
      V shown = hn::Mul(hn::Load(d, d_row), hn::Set(d, feature[0]));  // cotangent · features
      for (Index k = 1; k < channels; ++k) {
        shown = hn::MulAdd(hn::Load(d, d_row + k * kPixels), hn::Set(d, feature[k]), shown);
      }
      const V through = hn::Load(d, of_entry + p), behind = hn::Load(d, adjoint.behind + p);
      const V raw = hn::Mul(splat.opacity, gaussian), alpha = alpha_of(d, splat, gaussian, cap);
      hn::Store(hn::MulAdd(alpha, shown, hn::Mul(hn::Sub(one, alpha), behind)), d, adjoint.behind + p);
      if (wants_shape) {
        const V gate = hn::IfThenElse(hn::Gt(raw, cap), held_gradient, one);
        const SplatRow<Tag<S, W>> row(d, splat, center_y<S>(r));
        const V u = u_of(d, splat, row, center_x);
        const V vg = hn::Mul(hn::Mul(through, hn::Sub(shown, behind)), hn::Mul(gaussian, gate));
        const V vgu = hn::Mul(vg, u), vgw = hn::Mul(vg, row.w);
        m0 = hn::Add(m0, vg);
        m1 = hn::Add(m1, vgu);
        m2 = hn::Add(m2, vgw);
        m3 = hn::MulAdd(vgu, u, m3);
        m4 = hn::MulAdd(vgu, row.w, m4);
        m5 = hn::MulAdd(vgw, row.w, m5);
      }
      if (!wants_features) continue;
      const V weight = hn::Mul(through, alpha);
      if constexpr (kChannels == 3) {
        f0 = hn::MulAdd(weight, hn::Load(d, d_row), f0);
        f1 = hn::MulAdd(weight, hn::Load(d, d_row + kPixels), f1);
        f2 = hn::MulAdd(weight, hn::Load(d, d_row + 2 * kPixels), f2);
      } else {
        for (Index k = 0; k < channels; ++k) {
          S* const sum = adjoint.feature_sums + k * lanes;
          hn::Store(hn::MulAdd(weight, hn::Load(d, d_row + k * kPixels), hn::Load(d, sum)), d, sum);
        }
      }
    }
  }
  S* slot = adjoint.sums + static_cast<Index>(has_slot ? entry.slot : 0) * adjoint.stride;
  if (wants_shape) {
    for (const V m : {m0, m1, m2, m3, m4, m5}) *slot++ = hn::GetLane(hn::SumOfLanes(d, m));
  }
  if (!wants_features) return;
  if constexpr (kChannels == 3) {
    for (const V f : {f0, f1, f2}) *slot++ = hn::GetLane(hn::SumOfLanes(d, f));
  } else {
    for (Index k = 0; k < channels; ++k) {
      *slot++ = hn::GetLane(hn::SumOfLanes(d, hn::Load(d, adjoint.feature_sums + k * lanes)));
    }
  }
}

template <int W, int kChannels, class S>
void composite_adjoint(const CompositeScene<S>& scene, const TileJob<S>& job, const TileAdjoint<S>& adjoint) {
  constexpr int kPixels = W * W;
  Index end = 0;
  for (int p = 0; p < kPixels; ++p) end = std::max(end, static_cast<Index>(job.last[p]));
  while (end > 0) {
    const Index begin = (end - 1) / kSegment * kSegment;
    replay<W>(scene, job, begin, end, adjoint.segment);
    for (Index at = end - 1; at >= begin; --at) {
      adjoint_of_entry<W, kChannels>(scene, job, adjoint, job.entries[static_cast<size_t>(at)],
                                     adjoint.segment + (at - begin) * 2 * kPixels);
    }
    end = begin;
  }
}

// --- entry points ----------------------------------------------------------------------------------------------------

template <class S>
Index forward(Index side, const CompositeScene<S>& scene, const TileJob<S>& job) {
  const bool colors = scene.channels == 3;
  if (side == 16) return colors ? composite<16, 3>(scene, job) : composite<16, 0>(scene, job);
  return colors ? composite<8, 3>(scene, job) : composite<8, 0>(scene, job);
}

template <class S>
void backward(Index side, const CompositeScene<S>& scene, const TileJob<S>& job, const TileAdjoint<S>& adjoint) {
  const bool colors = scene.channels == 3;
  if (side == 16) {
    return colors ? composite_adjoint<16, 3>(scene, job, adjoint) : composite_adjoint<16, 0>(scene, job, adjoint);
  }
  colors ? composite_adjoint<8, 3>(scene, job, adjoint) : composite_adjoint<8, 0>(scene, job, adjoint);
}

template <class S>
PixelAlpha<S> pixel(const SplatRecord<S>& record, const CompositeRules<S>& rules, const TileJob<S>& job, Index row,
                    Index col) {
  const Tag<S, 16> d;
  const Splat<Tag<S, 16>> splat(d, job, record);
  const SplatRow<Tag<S, 16>> at_row(d, splat, center_y<S>(row));
  const auto gaussian = gaussian_of(d, splat, at_row, hn::Set(d, static_cast<S>(col) + S(0.5)));
  const S alpha = hn::GetLane(alpha_of(d, splat, gaussian, hn::Set(d, rules.alpha_cap)));
  return {alpha, alpha >= rules.alpha_min, hn::GetLane(hn::Mul(splat.opacity, gaussian)) > rules.alpha_cap};
}

Index forward_float(Index side, const CompositeScene<float>& scene, const TileJob<float>& job) {
  return forward(side, scene, job);
}
Index forward_double(Index side, const CompositeScene<double>& scene, const TileJob<double>& job) {
  return forward(side, scene, job);
}
void backward_float(Index side, const CompositeScene<float>& scene, const TileJob<float>& job,
                    const TileAdjoint<float>& adjoint) {
  backward(side, scene, job, adjoint);
}
void backward_double(Index side, const CompositeScene<double>& scene, const TileJob<double>& job,
                     const TileAdjoint<double>& adjoint) {
  backward(side, scene, job, adjoint);
}
PixelAlpha<float> pixel_float(const SplatRecord<float>& r, const CompositeRules<float>& rules,
                              const TileJob<float>& job, Index row, Index col) {
  return pixel(r, rules, job, row, col);
}
PixelAlpha<double> pixel_double(const SplatRecord<double>& r, const CompositeRules<double>& rules,
                                const TileJob<double>& job, Index row, Index col) {
  return pixel(r, rules, job, row, col);
}

}  // namespace hsi4d::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace hsi4d::detail {
HWY_EXPORT(forward_float);
HWY_EXPORT(forward_double);
HWY_EXPORT(backward_float);
HWY_EXPORT(backward_double);
HWY_EXPORT(pixel_float);
HWY_EXPORT(pixel_double);

template <>
Index composite_tile(Index side, const CompositeScene<float>& scene, const TileJob<float>& job) {
  return HWY_DYNAMIC_DISPATCH(forward_float)(side, scene, job);
}
template <>
Index composite_tile(Index side, const CompositeScene<double>& scene, const TileJob<double>& job) {
  return HWY_DYNAMIC_DISPATCH(forward_double)(side, scene, job);
}
template <>
void composite_tile_adjoint(Index side, const CompositeScene<float>& scene, const TileJob<float>& job,
                            const TileAdjoint<float>& adjoint) {
  HWY_DYNAMIC_DISPATCH(backward_float)(side, scene, job, adjoint);
}
template <>
void composite_tile_adjoint(Index side, const CompositeScene<double>& scene, const TileJob<double>& job,
                            const TileAdjoint<double>& adjoint) {
  HWY_DYNAMIC_DISPATCH(backward_double)(side, scene, job, adjoint);
}
template <>
PixelAlpha<float> pixel_alpha(const SplatRecord<float>& r, const CompositeRules<float>& rules,
                              const TileJob<float>& job, Index row, Index col) {
  return HWY_DYNAMIC_DISPATCH(pixel_float)(r, rules, job, row, col);
}
template <>
PixelAlpha<double> pixel_alpha(const SplatRecord<double>& r, const CompositeRules<double>& rules,
                               const TileJob<double>& job, Index row, Index col) {
  return HWY_DYNAMIC_DISPATCH(pixel_double)(r, rules, job, row, col);
}
}  // namespace hsi4d::detail
#endif
