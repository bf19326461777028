// What the pixel loops need of a projected Gaussian, made from the inputs of composite.h, and its adjoint. Not part of
// the public interface.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>

#include "autodiff/array.h"
#include "core/lanes.h"
#include "splat/limits.h"
#include "splat/render/project.h"
#include "splat/render/tiles.h"

namespace hsi4d::detail {

/// The inputs of composite, N rows each; see there.
template <class S>
struct SplatArrays {
  ConstArray<S> means, factors, depths, depth_low, means_low, opacities, features;
  Index rows() const { return means.shape.rows; }
};

/// The first features of a Gaussian, where a cache line has room for them beside the rest: colours.
template <class S>
struct RecordFeatures {
  static constexpr Index kCount = 0;
  void set(const S*, Index) {}
};
template <>
struct RecordFeatures<float> {
  static constexpr Index kCount = 3;
  float numbers[kCount];
  void set(const float* features, Index count) {
    for (Index k = 0; k < kCount; ++k) numbers[k] = k < count ? features[k] : 0.0f;
  }
};

template <class S>
struct alignas(64) SplatRecord {  // a cache line
  double x, y;      ///< mean, pixels; the loops use its place in the tile, which S holds to far more digits
  S l11, l21, l22;  ///< see Conic
  S opacity;        ///< with the antialias factor
  S log2_opacity;   ///< of an opacity held at or above kLeastOpacity
  std::int32_t row_begin, row_end;  ///< pixels
  [[no_unique_address]] RecordFeatures<S> features = {};
};
static_assert(sizeof(SplatRecord<float>) == 64 && sizeof(SplatRecord<double>) == 64);

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

/// Camera z of row n in double, metres.
template <class S>
double depth_of(const SplatArrays<S>& splats, Index n) {
  return static_cast<double>(splats.depths.data[n]) + static_cast<double>(splats.depth_low.data[n]);
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

/// What extents and records of some rows are made of. V: lanes of double.
template <class V>
struct SplatOutlines {
  ConicOf<V> conic;
  V x, y;          ///< mean, pixels
  V opacity;       ///< with the antialias factor
  V log2_opacity;  ///< of an opacity held at or above kLeastOpacity
  ReachOf<V> reach;
  LaneMask<V> drawn;
};

/// Outlines of rows [n, n + count), as many as there are lanes at most. Not drawn are rows with numbers that are not
/// finite, also once they are rounded to S, and those that are too near (rows A4-A6); their other numbers mean nothing.
template <class V, class S>
void outlines_of(const SplatArrays<S>& splats, const RenderSettings& settings, const ExtentRules& rules, Index n,
                 Index count, SplatOutlines<V>& o) {
  const auto load = [count](const ConstArray<S>& from, Index row, Index col) {
    return load_wide<kLanesOf<V>>(from.row(row) + col, from.shape.cols, count);
  };
  o.x = load(splats.means, n, 0) + load(splats.means_low, n, 0);
  o.y = load(splats.means, n, 1) + load(splats.means_low, n, 1);
  const V depth = load(splats.depths, n, 0) + load(splats.depth_low, n, 0);
  V factor[6];
  for (Index i = 0; i < 6; ++i) factor[i] = load(splats.factors, n, i);
  o.drawn = conic_of(factor, settings.blur, o.conic) & (depth > settings.near) & lane_finite(depth) & lane_finite(o.x) &
            lane_finite(o.y);
  LaneMask<V> some = factor[0] != 0.0;
  for (const V& v : factor) some = some | (v != 0.0);
  o.opacity = load(splats.opacities, n, 0);
  o.drawn = o.drawn & some & lane_finite(o.opacity);
  if (!any_lane(o.drawn)) return;
  if (settings.antialias) o.opacity = o.opacity * blur_compensation(o.conic);
  o.log2_opacity = lane_max(o.opacity, kLeastOpacity);
  for (Index i = 0; i < kLanesOf<V>; ++i) o.log2_opacity[i] = std::log2(o.log2_opacity[i]);
  for (const V& number : {o.conic.l11, o.conic.l21, o.conic.l22, o.opacity, o.log2_opacity}) {
    o.drawn = o.drawn & lane_finite(rounded_to<S>(number));
  }
  o.reach = reach_of(o.conic, o.x, o.log2_opacity, rules);
}

/// Not drawn are rows of which a feature is not finite. 0 times that is NaN: no branch.
template <class S>
bool has_finite_features(const ConstArray<S>& features, Index n) {
  S none = 0;
  for (Index k = 0; k < features.shape.cols; ++k) none += features.row(n)[k] * S(0);
  return none == S(0);
}

/// The extent of lane i of outlines; see extent_of.
template <class V>
Extent extent_at(const SplatOutlines<V>& o, Index i, const TileGrid& grid, const ExtentRules& rules) {
  const ConicOf<V>& c = o.conic;
  const Conic conic = {c.l11[i],        c.l21[i], c.l22[i], c.xx[i], c.xy[i], c.yy[i], c.sharp_determinant[i],
                       c.determinant[i]};
  return extent_of(conic, o.x[i], o.y[i], o.opacity[i], {}, grid, rules);
}

/// Records and extents of rows [n, n + count) from their outlines; an empty extent of one that is not drawn.
template <class V, class S>
void finish_records(const SplatArrays<S>& splats, const TileGrid& grid, const ExtentRules& rules, Index n, Index count,
                    const SplatOutlines<V>& o, SplatRecord<S>* records, Extent* extents) {
  using Rounded = Lanes<S, kLanesOf<V>>;
  if (!any_lane(o.drawn)) {  // the other numbers may not be set
    std::fill_n(extents, count, Extent{});
    return;
  }
  const bool of_ellipse = is_of_ellipse(rules);
  const LaneMask<V> reaches = may_be_drawn(o.opacity, rules);
  const Rounded l11 = convert_lanes<Rounded>(o.conic.l11), l21 = convert_lanes<Rounded>(o.conic.l21);
  const Rounded l22 = convert_lanes<Rounded>(o.conic.l22);
  const Rounded opacity = convert_lanes<Rounded>(o.opacity), log2_opacity = convert_lanes<Rounded>(o.log2_opacity);
  ExtentOf<V> ellipses;
  if (of_ellipse) ellipses = extent_within(o.reach, o.x, o.y, grid);
  for (Index i = 0; i < count; ++i) {
    extents[i] = {};
    if (!o.drawn[i] || !has_finite_features(splats.features, n + i)) continue;
    if (!of_ellipse) extents[i] = extent_at(o, i, grid, rules);
    if (of_ellipse && reaches[i]) extents[i] = extent_at(ellipses, i);
    // Number by number: of a record that is put together first, GCC reads wholes where it has just written parts.
    SplatRecord<S>& r = records[i];
    r.x = o.x[i];
    r.y = o.y[i];
    r.l11 = l11[i];
    r.l21 = l21[i];
    r.l22 = l22[i];
    r.opacity = opacity[i];
    r.log2_opacity = log2_opacity[i];
    r.row_begin = extents[i].row_begin;
    r.row_end = extents[i].row_end;
    r.features.set(splats.features.row(n + i), splats.features.shape.cols);
  }
}

/// Records and extents of rows [begin, end); the extents of those that are not drawn are empty, kCount at a
/// time: the same for any number. Call it in with_best_lanes.
///
/// @param records, extents  of row `begin`, and so on
template <Index kCount = kLanes, class S>
void make_records(const SplatArrays<S>& splats, const RenderSettings& settings, const TileGrid& grid, Index begin,
                  Index end, SplatRecord<S>* records, Extent* extents) {
  const ExtentRules rules = extent_rules(settings, static_cast<double>(std::numeric_limits<S>::epsilon()));
  SplatOutlines<DoubleLanes<kCount>> outlines;
  for (; begin < end; begin += kCount, records += kCount, extents += kCount) {
    const Index count = std::min(kCount, end - begin);
    outlines_of(splats, settings, rules, begin, count, outlines);
    finish_records(splats, grid, rules, begin, count, outlines, records, extents);
  }
}

/// The same of row n. False if it is not drawn.
template <class S>
bool make_record(const SplatArrays<S>& splats, const RenderSettings& settings, const TileGrid& grid, Index n,
                 SplatRecord<S>& record, Extent& extent) {
  make_records(splats, settings, grid, n, n + 1, &record, &extent);
  return extent.row_begin < extent.row_end;
}

/// Where the gradients of a set go; empty where none is wanted.
template <class S>
struct SplatGradients {
  Array<S> means, means_low, factors, opacities, features;
  bool of_shape() const { return means || means_low || factors || opacities; }
};

// With L = [l11 l21; 0 l22], v = ∂/∂ log α at a pixel and M the moments (Σ v u², …) as a symmetric matrix, from
// ds = −(L d)ᵀ L d_mean and ds = −½ (Lᵀ L d)ᵀ d_cov (Lᵀ L d):
//
//   d_mean = Lᵀ (Σ v u, Σ v w),   d_cov = ½ Lᵀ M L,   d_V = 2 d_cov V = Lᵀ M (L V)
//
// d_cov is that of the full symmetric matrix: its off-diagonal number counts twice (row B21). L is that of the record,
// with which u and w were made.

/// Adjoint of make_records: adds what the sums of rows [n, n + count), as many as there are lanes at most, over all
/// their pixels mean.
///
/// @param records    of row n, and so on
/// @param rows       those that have sums
/// @param d_opacity  Σ ∂/∂o, o with the antialias factor
/// @param moments    Σ v, Σ v u, Σ v w, Σ v u², Σ v u w, Σ v w²
template <class V, class S>
void add_record_gradients(const SplatArrays<S>& splats, const RenderSettings& settings, Index n, Index count,
                          const SplatRecord<S>* records, const LaneMask<V>& rows, V d_opacity, const V* moments,
                          const SplatGradients<S>& d) {
  constexpr Index kCount = kLanesOf<V>;
  V l11{}, l21{}, l22{};
  const V zero{};
  for (Index i = 0; i < std::min(count, kCount); ++i) {
    l11[i] = static_cast<double>(records[i].l11);
    l21[i] = static_cast<double>(records[i].l21);
    l22[i] = static_cast<double>(records[i].l22);
  }
  const auto add = [&](const Array<S>& to, Index col, const V& x) {
    if (to) add_lanes<S>(rows ? x : zero, to.row(n) + col, to.shape.cols, count);
  };
  const V d_x = l11 * moments[1], d_y = l21 * moments[1] + l22 * moments[2];
  for (const Array<S>& to : {d.means, d.means_low}) {
    add(to, 0, d_x);
    add(to, 1, d_y);
  }
  V v[6], d_v[6];
  for (Index i = 0; i < 6; ++i) v[i] = load_wide<kCount>(splats.factors.row(n) + i, 6, count);
  const auto lv = whitened_factor(v, settings.blur, l11, l22);
  for (std::size_t c = 0; c < 3; ++c) {
    const V mu = moments[3] * lv[c] + moments[4] * lv[3 + c], mw = moments[4] * lv[c] + moments[5] * lv[3 + c];
    d_v[c] = l11 * mu;
    d_v[3 + c] = l21 * mu + l22 * mw;
  }
  if (settings.antialias) {
    ConicOf<V> conic;
    conic_of(v, settings.blur, conic);
    const V opacity = load_wide<kCount>(splats.opacities.row(n), 1, count);
    blur_compensation_adjoint(v, settings.blur, conic, d_opacity * opacity, d_v);
    d_opacity = d_opacity * blur_compensation(conic);
  }
  add(d.opacities, 0, d_opacity);
  for (Index i = 0; i < 6; ++i) add(d.factors, i, d_v[i]);
}

}  // namespace hsi4d::detail
