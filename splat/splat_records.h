// What the pixel loops need of a projected Gaussian, made from the inputs of composite.h, and its adjoint. Not part of
// the public interface.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>

#include "autodiff/array.h"
#include "splat/limits.h"
#include "splat/project.h"
#include "splat/tiles.h"

namespace hsi4d::detail {

/// The inputs of composite, N rows each; see there.
template <class S>
struct SplatArrays {
  ConstArray<S> means, factors, depths, depth_rest, means_rest, opacities, features;
  Index rows() const { return means.shape.rows; }
};

template <class S>
struct alignas(64) SplatRecord {  // a cache line
  double x, y;      ///< mean, pixels; the loops use its place in the tile, which S holds to far more digits
  S l11, l21, l22;  ///< see Conic
  S opacity;        ///< with the antialias factor
  S log2_opacity;   ///< of an opacity held at or above kLeastOpacity
  std::int32_t row_begin, row_end;  ///< pixels
};

/// Settings as the pixel loops use them.
template <class S>
struct CompositeRules {
  S alpha_cap, alpha_min;
  S stop_below;    ///< a pixel is finished when T is below this; 0: never
  bool exclusive;  ///< the Gaussian that would finish the pixel is left out
  bool pass_cap;   ///< the gradient passes where the cap holds
  S blur = 0;      ///< pixels², already in the conics
};

template <class S>
CompositeRules<S> composite_rules(const RenderSettings& settings) {
  S stop = static_cast<S>(settings.transmittance_stop);
  if (stop > S(0) && settings.stop_when == StopWhen::kAtOrBelow) {
    stop = std::nextafter(stop, std::numeric_limits<S>::infinity());
  }
  return {static_cast<S>(settings.alpha_cap),
          static_cast<S>(settings.alpha_min),
          stop,
          settings.stop_rule == StopRule::kExclusive,
          settings.cap_gradient == CapGradient::kPass,
          static_cast<S>(settings.blur)};
}

template <class S>
bool all_finite(const S* x, Index n) {
  return std::all_of(x, x + n, [](S v) { return std::isfinite(v); });
}

template <class S>
void read_factor(const SplatArrays<S>& splats, Index n, double* factor) {
  const S* v = splats.factors.row(n);
  for (int i = 0; i < 6; ++i) factor[i] = static_cast<double>(v[i]);
}

/// Camera z of row n in double, metres.
template <class S>
double depth_of(const SplatArrays<S>& splats, Index n) {
  return static_cast<double>(splats.depths.data[n]) + static_cast<double>(splats.depth_rest.data[n]);
}

/// What a Gaussian at a depth is sorted by in a render of type S.
///
/// @param rounded  the depth as S holds it
template <class S>
std::uint64_t key_of_depth(const RenderSettings& settings, S rounded, double depth) {
  constexpr DepthKey kOwn = std::is_same_v<S, float> ? DepthKey::kFloat : DepthKey::kDouble;
  const bool in_float = settings.depth_key.value_or(kOwn) == DepthKey::kFloat;
  return in_float ? depth_bits(static_cast<float>(rounded)) : depth_bits(depth);
}

/// What row n is sorted by.
template <class S>
std::uint64_t depth_key(const SplatArrays<S>& splats, const RenderSettings& settings, Index n) {
  return key_of_depth(settings, splats.depths.data[n], depth_of(splats, n));
}

/// What extents and records are made of.
struct SplatOutline {
  Conic conic;
  double x, y;          ///< mean, pixels
  double opacity;       ///< with the antialias factor
  double log2_opacity;  ///< of an opacity held at or above kLeastOpacity
  bool drawn;
};

/// Outline of row n, without log2_opacity. Culls numbers that are not finite, then near, each before its numbers are
/// used (rows A4-A6).
template <class S>
void outline_of(const SplatArrays<S>& splats, const RenderSettings& settings, Index n, SplatOutline& outline) {
  const S *mean = splats.means.row(n), *mean_rest = splats.means_rest.row(n);
  const S depth = splats.depths.data[n], rest = splats.depth_rest.data[n], opacity = splats.opacities.data[n];
  outline.opacity = 0;
  outline.drawn = false;
  if (!all_finite(mean, 2) || !all_finite(mean_rest, 2) || !std::isfinite(depth) || !std::isfinite(rest) ||
      !std::isfinite(opacity))
    return;
  if (!(depth_of(splats, n) > settings.near)) return;
  double factor[6];
  read_factor(splats, n, factor);
  if (!is_drawn(factor) || !conic_of(factor, settings.blur, outline.conic)) return;
  outline.opacity = static_cast<double>(opacity) * (settings.antialias ? blur_compensation(outline.conic) : 1.0);
  outline.x = static_cast<double>(mean[0]) + static_cast<double>(mean_rest[0]);
  outline.y = static_cast<double>(mean[1]) + static_cast<double>(mean_rest[1]);
  outline.drawn = true;
}

/// Record and extent of row n from its outline; an empty extent if it is not drawn.
template <class S>
void finish_record(const SplatArrays<S>& splats, const TileGrid& grid, const ExtentRules& rules, Index n,
                   const SplatOutline& outline, SplatRecord<S>& record, Extent& extent) {
  extent = {};
  if (!outline.drawn || !all_finite(splats.features.row(n), splats.features.shape.cols)) return;
  const Conic& conic = outline.conic;
  record = {outline.x,
            outline.y,
            static_cast<S>(conic.l11),
            static_cast<S>(conic.l21),
            static_cast<S>(conic.l22),
            static_cast<S>(outline.opacity),
            static_cast<S>(outline.log2_opacity),
            0,
            0};
  if (!all_finite(&record.l11, 5)) return;
  extent = extent_of(conic, outline.x, outline.y, outline.opacity, outline.log2_opacity, grid, rules);
  record.row_begin = extent.row_begin;
  record.row_end = extent.row_end;
}

/// Records and extents of rows [begin, end); the extents of those that are not drawn are empty. In steps over some
/// rows at a time: a row's numbers follow from each other, and the processor looks ahead only so far.
///
/// @param records, extents  of row `begin`, and so on
template <class S>
void make_records(const SplatArrays<S>& splats, const RenderSettings& settings, const TileGrid& grid, Index begin,
                  Index end, SplatRecord<S>* records, Extent* extents) {
  constexpr Index kTogether = 32;
  const ExtentRules rules = extent_rules(settings, static_cast<double>(std::numeric_limits<S>::epsilon()));
  SplatOutline outlines[kTogether];
  for (; begin < end; begin += kTogether, records += kTogether, extents += kTogether) {
    const Index count = std::min(kTogether, end - begin);
    for (Index i = 0; i < count; ++i) outline_of(splats, settings, begin + i, outlines[i]);
    for (Index i = 0; i < count; ++i) {
      outlines[i].log2_opacity = std::log2(std::max(outlines[i].opacity, kLeastOpacity));
    }
    for (Index i = 0; i < count; ++i) {
      finish_record(splats, grid, rules, begin + i, outlines[i], records[i], extents[i]);
    }
  }
}

/// The same of row n. False if it is not drawn.
template <class S>
bool make_record(const SplatArrays<S>& splats, const RenderSettings& settings, const TileGrid& grid, Index n,
                 SplatRecord<S>& record, Extent& extent) {
  make_records(splats, settings, grid, n, n + 1, &record, &extent);
  return extent.row_begin < extent.row_end;
}

/// Where the gradients of one row go: its numbers, or null where none is wanted.
template <class S>
struct SplatGradient {
  S *mean = nullptr, *mean_rest = nullptr, *factor = nullptr, *opacity = nullptr;
  bool wanted() const { return mean != nullptr || mean_rest != nullptr || factor != nullptr || opacity != nullptr; }
};

// With L = [l11 l21; 0 l22], v = ∂/∂ log α at a pixel and M the moments (Σ v u², …) as a symmetric matrix, from
// ds = −(L d)ᵀ L d_mean and ds = −½ (Lᵀ L d)ᵀ d_cov (Lᵀ L d):
//
//   d_mean = Lᵀ (Σ v u, Σ v w),   d_cov = ½ Lᵀ M L,   d_V = 2 d_cov V = Lᵀ M (L V)
//
// d_cov is that of the full symmetric matrix: its off-diagonal number counts twice (row B21). L is that of the record,
// with which u and w were made.

/// Adjoint of make_records: adds what the sums of row n over all its pixels mean.
///
/// @param d_opacity  Σ ∂/∂o, o with the antialias factor
/// @param moments    Σ v, Σ v u, Σ v w, Σ v u², Σ v u w, Σ v w²
template <class S>
void add_record_gradient(const SplatArrays<S>& splats, const RenderSettings& settings, Index n,
                         const SplatRecord<S>& record, double d_opacity, const double* moments,
                         const SplatGradient<S>& d) {
  const double l11 = static_cast<double>(record.l11), l21 = static_cast<double>(record.l21);
  const double l22 = static_cast<double>(record.l22);
  for (S* const d_mean : {d.mean, d.mean_rest}) {
    if (d_mean == nullptr) continue;
    d_mean[0] += static_cast<S>(l11 * moments[1]);
    d_mean[1] += static_cast<S>(l21 * moments[1] + l22 * moments[2]);
  }
  double v[6], d_v[6];
  read_factor(splats, n, v);
  const auto lv = whitened_factor(v, settings.blur, l11, l22);
  for (int c = 0; c < 3; ++c) {
    const double lu = lv[static_cast<std::size_t>(c)], lw = lv[static_cast<std::size_t>(3 + c)];
    const double mu = moments[3] * lu + moments[4] * lw, mw = moments[4] * lu + moments[5] * lw;
    d_v[c] = l11 * mu;
    d_v[3 + c] = l21 * mu + l22 * mw;
  }
  if (settings.antialias) {
    Conic conic;
    conic_of(v, settings.blur, conic);
    const double opacity = static_cast<double>(splats.opacities.data[n]);
    blur_compensation_adjoint(v, settings.blur, conic, d_opacity * opacity, d_v);
    d_opacity *= blur_compensation(conic);
  }
  if (d.opacity != nullptr) *d.opacity += static_cast<S>(d_opacity);
  for (int i = 0; i < 6 && d.factor != nullptr; ++i) d.factor[i] += static_cast<S>(d_v[i]);
}

}  // namespace hsi4d::detail
