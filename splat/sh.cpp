#include "splat/sh.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/parallel.h"
#include "core/simd.h"
#include "splat/sh_basis.h"

namespace hsi4d {

namespace {

constexpr Index kGrain = 512;
constexpr int kMostCoefficients = (kHighestShDegree + 1) * (kHighestShDegree + 1);

// --- colours ---------------------------------------------------------------------------------------------------------

/// Direction from the camera's centre to a mean; (0, 0, 1) where they are the same point.
template <class S>
Direction<double, 3> view_direction(const Vector3<double>& center, const S* mean) {
  const Vector3<double> m(static_cast<double>(mean[0]), static_cast<double>(mean[1]), static_cast<double>(mean[2]));
  Direction<double, 3> direction = direction_of(Vector3<double>(m - center));
  if (!direction.usable) direction.unit = Vector3<double>::UnitZ();
  return direction;
}

/// max(0, ½ + Σ Y sh) of a channel; NaN where the sum is not finite, also −∞, so that the Gaussian is not drawn.
template <class S>
S held_color(S sum) {
  if (!std::isfinite(sum)) return std::numeric_limits<S>::quiet_NaN();
  return sum > S(0) ? sum : S(0);
}

/// ½ + Σ Y sh of a channel.
template <class S>
S color_sum(const S* basis, const S* sh, int coefficients, int channel) {
  S sum = S(0.5);
  for (int k = 0; k < coefficients; ++k) sum += basis[k] * sh[3 * k + channel];
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

  struct Seen {
    Direction<double, 3> direction;  // world
    Vector3<S> local;                // in the object's axes
    S basis[kMostCoefficients];
  };

  /// What a Gaussian is seen by; nothing to do at degree 0.
  Seen seen(const NodeIo<S>& io, const Vector3<double>& center, const Matrix3<double>& linear, Index n) const {
    Seen s{{}, Vector3<S>(S(0), S(0), S(1)), {}};
    if (has_direction(io)) {
      s.direction = view_direction(center, io.in(kMeans).row(n));
      s.local = (linear.transpose() * s.direction.unit).template cast<S>();
    }
    sh_basis(degree, s.local[0], s.local[1], s.local[2], s.basis);
    return s;
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
        for (Index n = begin; n < end; ++n) {
          const Seen s = seen(io, center, linear, n);
          for (int c = 0; c < 3; ++c) {
            colors.row(n)[c] = held_color(color_sum(s.basis, sh.row(n), coefficients(), c));
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
      Vector3<double> sum_m = Vector3<double>::Zero();
      Matrix3<double> sum_a = Matrix3<double>::Zero();
      on_best_isa([&] {
        for (Index n = begin; n < end; ++n) {
          const S* color = colors.row(n);
          if (!std::isfinite(color[0] + color[1] + color[2])) continue;  // keeps 0·∞ out
          S g[3];
          for (int c = 0; c < 3; ++c) g[c] = color[c] > S(0) ? d_colors.row(n)[c] : S(0);
          if (g[0] == S(0) && g[1] == S(0) && g[2] == S(0)) continue;
          const Seen s = seen(io, center, linear, n);
          if (d_sh) {
            for (int k = 0; k < coefficients(); ++k) {
              for (int c = 0; c < 3; ++c) d_sh.row(n)[3 * k + c] += s.basis[k] * g[c];
            }
          }
          if (!wants_direction || !s.direction.usable) continue;
          S d_basis[kMostCoefficients];
          for (int k = 0; k < coefficients(); ++k) {
            const S* of_k = sh.row(n) + 3 * k;
            d_basis[k] = g[0] * of_k[0] + g[1] * of_k[1] + g[2] * of_k[2];
          }
          S d_local[3] = {};
          sh_basis_adjoint(degree, s.local[0], s.local[1], s.local[2], d_basis, d_local);
          const Vector3<double> d_l(static_cast<double>(d_local[0]), static_cast<double>(d_local[1]),
                                    static_cast<double>(d_local[2]));
          if (wants_transform) sum_a += s.direction.unit * d_l.transpose();
          Vector3<double> d_m = Vector3<double>::Zero();
          direction_adjoint(s.direction, Vector3<double>(linear * d_l), d_m);
          sum_m += d_m;
          for (int i = 0; i < 3 && d_means; ++i) d_means.row(n)[i] += static_cast<S>(d_m[i]);
        }
      });
      for (Index i = 0; i < 3; ++i) partials[static_cast<std::size_t>(i * part.chunks() + chunk)] = sum_m[i];
      for (Index i = 0; i < 9; ++i) {
        partials[static_cast<std::size_t>((3 + i) * part.chunks() + chunk)] = sum_a(i / 3, i % 3);
      }
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
