#include "splat/render/sh.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "core/lanes.h"
#include "core/parallel.h"
#include "core/simd.h"
#include "splat/sh_basis.h"

namespace hsi4d {

namespace {

constexpr Index kGrain = 512;
constexpr int kMostCoefficients = (kHighestShDegree + 1) * (kHighestShDegree + 1);

// --- colours ---------------------------------------------------------------------------------------------------------

/// From the camera's centre to eight means; (0, 0, 1) where they are the same point, NaN where one is not finite.
struct ViewDirections {
  WideLanes unit[3], length;
  LaneMask<WideLanes> usable;
};

/// As direction_of: divided by the largest component first, so that nothing under- or overflows.
template <class S>
ViewDirections view_directions(const Vector3<double>& center, const S* means, Index count) {
  const WideLanes zero{}, one = lane_constant<WideLanes>(1);
  const WideLanes none = lane_constant<WideLanes>(std::numeric_limits<double>::quiet_NaN());
  ViewDirections d{};
  for (int i = 0; i < 3; ++i) d.unit[i] = load_wide(means + i, 3, count) - center[i];
  const WideLanes largest = lane_max(lane_max(lane_abs(d.unit[0]), lane_abs(d.unit[1])), lane_abs(d.unit[2]));
  const LaneMask<WideLanes> finite = lane_finite(d.unit[0]) & lane_finite(d.unit[1]) & lane_finite(d.unit[2]);
  d.usable = finite & (largest > zero);
  const WideLanes scale = d.usable ? largest : one;
  WideLanes square = zero;
  for (WideLanes& x : d.unit) {
    x = (d.usable ? x : zero) / scale;
    square = square + x * x;
  }
  const WideLanes norm = d.usable ? lane_sqrt(square) : one, inverse = one / norm;
  for (int i = 0; i < 3; ++i) {
    const WideLanes otherwise = i == 2 ? one : zero;
    d.unit[i] = d.usable ? d.unit[i] * inverse : (finite ? otherwise : none);
  }
  d.length = norm * scale;
  return d;
}

/// max(0, ½ + Σ Y sh) of a channel; NaN where the sum is not finite, also −∞, so that the Gaussian is not drawn.
template <class S>
S held_color(S sum) {
  if (!std::isfinite(sum)) return std::numeric_limits<S>::quiet_NaN();
  return sum > S(0) ? sum : S(0);
}

/// ½ + Σ Y sh of a channel.
template <class S>
S color_sum(const S (*basis)[kLanes], Index lane, const S* sh, int coefficients, int channel) {
  S sum = S(0.5);
  for (int k = 0; k < coefficients; ++k) sum += basis[k][lane] * sh[3 * k + channel];
  return sum;
}

template <class S>
struct ShColors {
  static constexpr const char* kName = "sh_colors";
  SplatView view;
  int degree = 0;

  enum Input { kSh, kMeans, kXi, kTransform };

  int coefficients() const { return (degree + 1) * (degree + 1); }
  bool has_direction(const NodeIo<S>& io) const { return io.inputs() > 1; }

  /// Linear part of the object's transform, the identity without one.
  static Matrix3<double> linear_part(const NodeIo<S>& io) {
    Matrix3<double> a = Matrix3<double>::Identity();
    if (io.inputs() <= kTransform) return a;
    const S* t = io.in(kTransform).data;
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) a(r, c) = static_cast<double>(t[4 * r + c]);
    }
    return a;
  }

  /// What eight Gaussians are seen by; nothing to do at degree 0.
  struct Seen {
    ViewDirections direction;  // world
    Lanes<S> local[3];         // in the object's axes
    alignas(kAlignment) S basis[kMostCoefficients][kLanes];
  };

  void see(const NodeIo<S>& io, const Vector3<double>& center, const Matrix3<double>& linear, Index n, Index count,
           Seen& s) const {
    s.local[0] = s.local[1] = Lanes<S>{};
    s.local[2] = lane_constant<Lanes<S>>(1);
    if (has_direction(io)) {
      s.direction = view_directions(center, io.in(kMeans).row(n), count);
      for (int r = 0; r < 3; ++r) {
        const WideLanes turned = linear(0, r) * s.direction.unit[0] + linear(1, r) * s.direction.unit[1] +
                                 linear(2, r) * s.direction.unit[2];
        s.local[r] = convert_lanes<Lanes<S>>(turned);
      }
    }
    Lanes<S> basis[kMostCoefficients];
    sh_basis(degree, s.local[0], s.local[1], s.local[2], basis);
    for (int k = 0; k < coefficients(); ++k) std::memcpy(s.basis[k], &basis[k], sizeof basis[k]);
  }

  Vector3<double> center_of(const NodeIo<S>& io) const {
    if (!has_direction(io)) return Vector3<double>::Zero();
    return detail::moved_camera(view, detail::camera_update(io.in(kXi))).center;
  }

  void forward(NodeIo<S>& io) {
    const ConstArray<S> sh = io.in(kSh);
    const Array<S> colors = io.out();
    const Vector3<double> center = center_of(io);
    const Matrix3<double> linear = linear_part(io);
    parallel_for(sh.shape.rows, kGrain, [&](Index begin, Index end) {
      on_best_isa([&] {
        Seen s{};
        for (Index n = begin; n < end; n += kLanes) {
          const Index count = std::min(kLanes, end - n);
          see(io, center, linear, n, count, s);
          for (Index i = 0; i < count; ++i) {
            for (int c = 0; c < 3; ++c)
              colors.row(n + i)[c] = held_color(color_sum(s.basis, i, sh.row(n + i), coefficients(), c));
          }
        }
      });
    });
  }

  // d_sh_k = Y_k g,  d_Y_k = g·sh_k,  g the colour's gradient where the sum is positive, else 0
  // d_r' = Σ d_Y ∂Y/∂r',  d_A = r d_r'ᵀ,  d_r = A d_r',  d_m = (d_r − r (r·d_r))/|m − c|,  d_δ_ρ = W⁻ᵀ Σ d_m
  void backward(NodeIo<S>& io) {
    const ConstArray<S> sh = io.in(kSh), colors = io.out(), d_colors = io.d_out();
    const bool directed = has_direction(io);
    const bool wants_xi = directed && io.wants(kXi), wants_transform = io.inputs() > kTransform && io.wants(kTransform);
    const Array<S> d_sh = io.wants(kSh) ? io.d_in(kSh) : Array<S>{};
    const Array<S> d_means = directed && io.wants(kMeans) ? io.d_in(kMeans) : Array<S>{};
    const bool wants_direction = d_means || wants_xi || wants_transform;
    const Vector3<double> center = center_of(io);
    const Matrix3<double> linear = linear_part(io);
    const Partition part = reduction_partition(sh.shape.rows, kGrain);
    constexpr Index kSums = 12;  // of d_m, and of d_A
    const std::span<double> partials = io.template scratch<double>(kSums * part.chunks());
    parallel_chunks(part, [&](Index chunk, Index begin, Index end) {
      WideLanes sums[kSums] = {};
      on_best_isa([&] {
        Seen s{};
        for (Index n = begin; n < end; n += kLanes) {
          const Index count = std::min(kLanes, end - n);
          Cotangents g{};
          if (!load_cotangents(colors, d_colors, n, count, g)) continue;
          see(io, center, linear, n, count, s);
          if (d_sh) add_coefficients(s, g, n, count, d_sh);
          if (wants_direction) add_directions(s, g, sh, linear, n, count, d_means, sums);
        }
      });
      for (Index i = 0; i < kSums; ++i)
        partials[static_cast<std::size_t>(i * part.chunks() + chunk)] = sum_of_lanes<double>(sums[i]);
    });
    const auto total = [&](Index i) { return pairwise_sum(partials.data() + i * part.chunks(), part.chunks()); };
    for (Index i = 0; i < 9 && wants_transform; ++i) {
      io.d_in(kTransform).data[4 * (i / 3) + i % 3] += static_cast<S>(total(3 + i));
    }
    if (!wants_xi) return;
    const Matrix3<double> inverse = detail::moved_camera(view, detail::camera_update(io.in(kXi))).inverse;
    Vector6<double> d_delta = Vector6<double>::Zero();
    d_delta.head<3>() = inverse.transpose() * Vector3<double>(total(0), total(1), total(2));
    detail::add_camera_gradient(io.in(kXi), std::span<const double>(d_delta.data(), 6), 1, io.d_in(kXi));
  }

  /// Gradients of eight colours, 0 where there is none; a Gaussian whose colour is not finite has none.
  struct Cotangents {
    S of[kLanes][3];
    bool any[kLanes];
  };

  /// False if there is nothing.
  static bool load_cotangents(const ConstArray<S>& colors, const ConstArray<S>& d_colors, Index n, Index count,
                              Cotangents& g) {
    bool any = false;
    for (Index i = 0; i < count; ++i) {
      const S *const color = colors.row(n + i), *const d = d_colors.row(n + i);
      const bool finite = std::isfinite(color[0] + color[1] + color[2]);
      for (int c = 0; c < 3; ++c) g.of[i][c] = finite && color[c] > S(0) ? d[c] : S(0);
      g.any[i] = g.of[i][0] != S(0) || g.of[i][1] != S(0) || g.of[i][2] != S(0);
      any = any || g.any[i];
    }
    return any;
  }

  void add_coefficients(const Seen& s, const Cotangents& g, Index n, Index count, const Array<S>& d_sh) const {
    for (Index i = 0; i < count; ++i) {
      for (int k = 0; k < coefficients() && g.any[i]; ++k) {
        for (int c = 0; c < 3; ++c) d_sh.row(n + i)[3 * k + c] += s.basis[k][i] * g.of[i][c];
      }
    }
  }

  /// @param sums  of d_m, and of d_A
  void add_directions(const Seen& s, const Cotangents& g, const ConstArray<S>& sh, const Matrix3<double>& linear,
                      Index n, Index count, const Array<S>& d_means, WideLanes* sums) const {
    Lanes<S> d_basis[kMostCoefficients] = {}, d_local[3] = {};
    LaneMask<WideLanes> counts{};
    for (Index i = 0; i < count; ++i) {
      counts[i] = g.any[i] && s.direction.usable[i] ? -1 : 0;
      for (int k = 0; k < coefficients() && counts[i]; ++k) {
        const S* of_k = sh.row(n + i) + 3 * k;
        d_basis[k][i] = g.of[i][0] * of_k[0] + g.of[i][1] * of_k[1] + g.of[i][2] * of_k[2];
      }
    }
    sh_basis_adjoint(degree, s.local[0], s.local[1], s.local[2], d_basis, d_local);
    const WideLanes zero{};
    WideLanes d_l[3], d_r[3], along = zero;
    for (int i = 0; i < 3; ++i) d_l[i] = counts ? convert_lanes<WideLanes>(d_local[i]) : zero;
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c)
        sums[3 + 3 * r + c] = sums[3 + 3 * r + c] + (counts ? s.direction.unit[r] * d_l[c] : zero);
      d_r[r] = linear(r, 0) * d_l[0] + linear(r, 1) * d_l[1] + linear(r, 2) * d_l[2];
      along = along + s.direction.unit[r] * d_r[r];
    }
    // As direction_adjoint; nothing where the mean is too near for a direction.
    counts = counts & (s.direction.length >= lane_constant<WideLanes>(smallest_length<double>()));
    for (int i = 0; i < 3; ++i) {
      const WideLanes d_m = counts ? (d_r[i] - s.direction.unit[i] * along) / s.direction.length : zero;
      sums[i] = sums[i] + d_m;
      if (d_means) add_lanes<S>(d_m, d_means.row(n) + i, 3, count);
    }
  }

  /// Which channels are held at 0.
  void add_signature(Signature& signature, NodeIo<S>& io) {
    const ConstArray<S> colors = io.out();
    for (Index i = 0; i < colors.shape.count(); ++i) signature.add(colors.data[i] > S(0) ? 1 : 2);
  }
};

}  // namespace

template <class S>
Var<S> sh_colors(Var<S> sh, Var<S> means, Var<S> xi, const SplatView& view, Var<S> transform, Source where) {
  check_camera(view.camera);
  const Index rows = sh.shape().rows, coefficients = sh.shape().cols / 3;
  int degree = 0;
  while (degree < kHighestShDegree && (degree + 1) * (degree + 1) < coefficients) ++degree;
  HSI4D_CHECK_EQ(sh.shape(), shape_of(rows, 3 * (degree + 1) * (degree + 1)));
  HSI4D_CHECK_EQ(means.shape(), shape_of(rows, 3));
  HSI4D_CHECK_EQ(xi.shape(), shape_of(1, 6));
  if (transform.tape != nullptr) HSI4D_CHECK_EQ(transform.shape(), shape_of(1, 12));
  ShColors<S> op{view, std::min(degree, view.settings.sh_degree)};
  Tape<S>& tape = sh.owner();
  const Shape colors = shape_of(rows, 3);
  if (op.degree == 0) return tape.record(op, {sh}, colors, where);
  if (transform.tape == nullptr) return tape.record(op, {sh, means, xi}, colors, where);
  return tape.record(op, {sh, means, xi, transform}, colors, where);
}

template Var<float> sh_colors(Var<float>, Var<float>, Var<float>, const SplatView&, Var<float>, Source);
template Var<double> sh_colors(Var<double>, Var<double>, Var<double>, const SplatView&, Var<double>, Source);

}  // namespace hsi4d
