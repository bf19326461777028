#include "splat/render/covariance.h"

#include <cmath>

#include "core/lanes.h"
#include "core/parallel.h"
#include "core/quaternion.h"
#include "core/simd.h"
#include "core/vector_exp.h"
#include "splat/limits.h"

namespace hsi4d {

namespace {

constexpr Index kGrain = 1024;

template <class S>
using RowMatrix3 = Eigen::Matrix<S, 3, 3, Eigen::RowMajor>;
template <class S>
using MatrixRow = Eigen::Map<RowMatrix3<S>>;
template <class S>
using ConstMatrixRow = Eigen::Map<const RowMatrix3<S>>;

// --- axes of one Gaussian --------------------------------------------------------------------------------------------

/// False where the log-scale is held: its gradient stops there.
template <class S>
bool scale_is_free(S log_scale) {
  return log_scale >= S(-kLogScaleLimit) && log_scale <= S(kLogScaleLimit);
}

template <class S>
S held_scale(S log_scale) {
  constexpr S kLimit = S(kLogScaleLimit);
  return vector_exp(log_scale < -kLimit ? -kLimit : (log_scale > kLimit ? kLimit : log_scale));
}

/// Direction, length and scales of some Gaussians.
template <class S>
struct RotatedScales {
  Lanes<S> unit[4], length;  ///< as direction_of; rows that are not drawn have any numbers
  Lanes<S> rotation[9];
  Lanes<S> scales[3];
  LaneMask<Lanes<S>> drawn;
};

/// @param q, l    of the first of `count` rows
template <class S>
RotatedScales<S> read_gaussians(const S* q, const S* l, Index count) {
  RotatedScales<S> g;
  Lanes<S> largest{};
  g.drawn = first_lanes<S>(kLanes);
  S logs[3 * kLanes];
  for (Index i = 0; i < 3; ++i) {
    const Lanes<S> log_scale = load_lanes(l + i, 3, count);
    g.drawn = g.drawn & (log_scale == log_scale);
    store_lanes<S>(log_scale, logs + i * kLanes, 1, kLanes);
  }
  for (S& number : logs) number = held_scale(number);
  for (Index i = 0; i < 3; ++i) g.scales[i] = load_lanes(logs + i * kLanes, 1, kLanes);
  for (Index i = 0; i < 4; ++i) {
    g.unit[i] = load_lanes(q + i, 4, count);
    g.drawn = g.drawn & lane_finite(g.unit[i]);
    largest = lane_max(largest, lane_abs(g.unit[i]));
  }
  g.drawn = g.drawn & (largest > S(0));
  for (Lanes<S>& number : g.unit) number = number / largest;
  const Lanes<S>* const u = g.unit;
  const Lanes<S> norm = lane_sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2] + u[3] * u[3]);
  for (Lanes<S>& number : g.unit) number = number / norm;
  g.length = norm * largest;
  detail::unit_quaternion_to_matrix(g.unit, g.rotation);
  return g;
}

template <class S>
void axes_of(const S* q, const S* l, Index count, S* axes) {
  const RotatedScales<S> g = read_gaussians(q, l, count);
  for (int i = 0; i < 9; ++i) {
    const Lanes<S> axis = g.rotation[i] * g.scales[i % 3];
    store_lanes<S>(g.drawn ? axis : Lanes<S>{}, axes + i, 9, count);
  }
}

/// d_R = d_M diag(s),  d_l_c = s_c Σ_r R_rc d_M_rc. Either result may be null.
template <class S>
void axes_adjoint(const S* q, const S* l, const S* d_axes, Index count, S* d_q, S* d_l) {
  const RotatedScales<S> g = read_gaussians(q, l, count);
  Lanes<S> d_m[9];
  for (int i = 0; i < 9; ++i) d_m[i] = load_lanes(d_axes + i, 9, count);
  for (int c = 0; d_l != nullptr && c < 3; ++c) {
    const Lanes<S> d =
        g.scales[c] * (g.rotation[c] * d_m[c] + g.rotation[3 + c] * d_m[3 + c] + g.rotation[6 + c] * d_m[6 + c]);
    const Lanes<S> log_scale = load_lanes(l + c, 3, count);
    const auto free = g.drawn & (lane_abs(log_scale) <= S(kLogScaleLimit));
    add_lanes<S>(free ? d : Lanes<S>{}, d_l + c, 3, count);
  }
  if (d_q == nullptr) return;
  for (int i = 0; i < 9; ++i) d_m[i] = d_m[i] * g.scales[i % 3];
  Lanes<S> d_unit[4];
  detail::unit_quaternion_gradient(g.unit, d_m, d_unit);
  const Lanes<S> along = g.unit[0] * d_unit[0] + g.unit[1] * d_unit[1] + g.unit[2] * d_unit[2] + g.unit[3] * d_unit[3];
  const auto long_enough = g.drawn & (g.length >= smallest_length<S>());
  for (int i = 0; i < 4; ++i) {
    const Lanes<S> d = (d_unit[i] - g.unit[i] * along) / g.length;
    add_lanes<S>(long_enough ? d : Lanes<S>{}, d_q + i, 4, count);
  }
}

template <class S>
struct GaussianAxes {
  static constexpr const char* kName = "gaussian_axes";

  void forward(NodeIo<S>& io) {
    const ConstArray<S> q = io.in(0), l = io.in(1);
    const Array<S> axes = io.out();
    parallel_for(q.shape.rows, kGrain, [&](Index begin, Index end) {
      on_best_isa([&] {
        for (Index n = begin; n < end; n += kLanes) axes_of(q.row(n), l.row(n), end - n, axes.row(n));
      });
    });
  }

  void backward(NodeIo<S>& io) {
    const ConstArray<S> q = io.in(0), l = io.in(1), d_axes = io.d_out();
    const Array<S> d_q = io.wants(0) ? io.d_in(0) : Array<S>{};
    const Array<S> d_l = io.wants(1) ? io.d_in(1) : Array<S>{};
    parallel_for(q.shape.rows, kGrain, [&](Index begin, Index end) {
      on_best_isa([&] {
        for (Index n = begin; n < end; n += kLanes) {
          axes_adjoint(q.row(n), l.row(n), d_axes.row(n), end - n, d_q ? d_q.row(n) : nullptr,
                       d_l ? d_l.row(n) : nullptr);
        }
      });
    });
  }

  void add_signature(Signature& signature, NodeIo<S>& io) {
    const ConstArray<S> l = io.in(1);
    for (Index i = 0; i < l.shape.count(); ++i) signature.add(scale_is_free(l.data[i]) ? 1 : 2);
  }
};

// --- a linear map of the axes ----------------------------------------------------------------------------------------

/// Linear part of a row [3,4].
template <class S>
RowMatrix3<S> linear_part(const S* t) {
  RowMatrix3<S> a;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) a(r, c) = t[4 * r + c];
  }
  return a;
}

template <class S>
struct TransformAxes {
  static constexpr const char* kName = "transform_axes";

  void forward(NodeIo<S>& io) {
    const ConstArray<S> t = io.in(0), axes = io.in(1);
    const Array<S> moved = io.out();
    const Index step = t.shape.rows == axes.shape.rows ? 1 : 0;
    parallel_for(axes.shape.rows, kGrain, [&](Index begin, Index end) {
      on_best_isa([&] {
        for (Index n = begin; n < end; ++n) {
          MatrixRow<S>(moved.row(n)) = linear_part(t.row(n * step)).lazyProduct(ConstMatrixRow<S>(axes.row(n)));
        }
      });
    });
  }

  // d_A = d_M' Mᵀ,  d_M = Aᵀ d_M'
  void backward(NodeIo<S>& io) {
    const ConstArray<S> t = io.in(0), axes = io.in(1), d_moved = io.d_out();
    const Index rows = axes.shape.rows, step = t.shape.rows == rows ? 1 : 0;
    if (io.wants(1)) {
      const Array<S> d_axes = io.d_in(1);
      parallel_for(rows, kGrain, [&](Index begin, Index end) {
        on_best_isa([&] {
          for (Index n = begin; n < end; ++n) {
            MatrixRow<S>(d_axes.row(n)) +=
                linear_part(t.row(n * step)).transpose().lazyProduct(ConstMatrixRow<S>(d_moved.row(n)));
          }
        });
      });
    }
    if (!io.wants(0)) return;
    const Array<S> d_t = io.d_in(0);
    if (step == 1) {
      parallel_for(rows, kGrain, [&](Index begin, Index end) {
        for (Index n = begin; n < end; ++n) {
          const RowMatrix3<S> d_a =
              ConstMatrixRow<S>(d_moved.row(n)).lazyProduct(ConstMatrixRow<S>(axes.row(n)).transpose());
          for (int i = 0; i < 9; ++i) d_t.row(n)[4 * (i / 3) + i % 3] += d_a.data()[i];
        }
      });
      return;
    }
    const Partition part = reduction_partition(rows, kGrain);
    const std::span<double> partials = io.template scratch<double>(9 * part.chunks());
    parallel_chunks(part, [&](Index chunk, Index begin, Index end) {
      RowMatrix3<double> sum = RowMatrix3<double>::Zero();
      for (Index n = begin; n < end; ++n) {
        sum += ConstMatrixRow<S>(d_moved.row(n))
                   .template cast<double>()
                   .lazyProduct(ConstMatrixRow<S>(axes.row(n)).template cast<double>().transpose());
      }
      for (Index i = 0; i < 9; ++i) partials[static_cast<std::size_t>(i * part.chunks() + chunk)] = sum.data()[i];
    });
    for (Index i = 0; i < 9; ++i) {
      const double sum = pairwise_sum(partials.data() + i * part.chunks(), part.chunks());
      d_t.data[4 * (i / 3) + i % 3] += static_cast<S>(sum);
    }
  }
};

}  // namespace

template <class S>
Var<S> gaussian_axes(Var<S> quats, Var<S> log_scales, Source where) {
  const Index rows = quats.shape().rows;
  HSI4D_CHECK_EQ(quats.shape(), shape_of(rows, 4));
  HSI4D_CHECK_EQ(log_scales.shape(), shape_of(rows, 3));
  return quats.owner().record(GaussianAxes<S>{}, {quats, log_scales}, shape_of(rows, 9), where);
}

template <class S>
Var<S> transform_axes(Var<S> transforms, Var<S> axes, Source where) {
  const Index rows = axes.shape().rows;
  HSI4D_CHECK_EQ(axes.shape(), shape_of(rows, 9));
  HSI4D_CHECK_EQ(transforms.shape(), shape_of(transforms.shape().rows == 1 ? 1 : rows, 12));
  return axes.owner().record(TransformAxes<S>{}, {transforms, axes}, shape_of(rows, 9), where);
}

#define HSI4D_INSTANTIATE(S)                             \
  template Var<S> gaussian_axes(Var<S>, Var<S>, Source); \
  template Var<S> transform_axes(Var<S>, Var<S>, Source);
HSI4D_INSTANTIATE(float)
HSI4D_INSTANTIATE(double)
#undef HSI4D_INSTANTIATE

}  // namespace hsi4d
