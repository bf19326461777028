#include "body/canonical_directions.h"

#include "core/linear.h"
#include "core/parallel.h"
#include "core/simd.h"

namespace hsi4d {

namespace {

constexpr Index kGrain = 1024;

template <class S>
struct CanonicalDirectionsOp {
  static constexpr const char* kName = "canonical_directions";
  enum Input { kTransforms, kPoints, kCenter };

  struct Seen {
    Matrix3<double> linear;
    Vector3<double> from_center;
    Direction<double, 3> direction;
  };
  static Seen seen(const S* transform, const S* point, const S* center) {
    Seen s;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) s.linear(i, j) = static_cast<double>(transform[4 * i + j]);
      s.from_center[i] = static_cast<double>(point[i]) - static_cast<double>(center[i]);
    }
    s.direction = direction_of(Vector3<double>(s.linear.transpose() * s.from_center));
    if (!s.direction.usable) s.direction.unit = Vector3<double>::UnitZ();
    return s;
  }

  void forward(NodeIo<S>& io) {
    const ConstArray<S> transforms = io.in(kTransforms), points = io.in(kPoints), center = io.in(kCenter);
    const Array<S> directions = io.out();
    parallel_for(points.shape.rows, kGrain, [&](Index begin, Index end) {
      on_best_isa([&] {
        for (Index n = begin; n < end; ++n) {
          const Seen s = seen(transforms.row(n), points.row(n), center.data);
          for (int i = 0; i < 3; ++i) directions.row(n)[i] = static_cast<S>(s.direction.unit[i]);
        }
      });
    });
  }

  // d_w = (d_v − v (v·d_v))/|w|;   d_L += (p − c) d_wᵀ,  d_p += L d_w,  d_c −= Σ L d_w
  void backward(NodeIo<S>& io) {
    const ConstArray<S> transforms = io.in(kTransforms), points = io.in(kPoints), center = io.in(kCenter);
    const ConstArray<S> d_directions = io.d_out();
    const Partition part = reduction_partition(points.shape.rows, kGrain);
    const std::span<double> partials = io.template scratch<double>(3 * part.chunks());
    parallel_chunks(part, [&](Index chunk, Index begin, Index end) {
      Vector3<double> sum = Vector3<double>::Zero();
      on_best_isa([&] {
        for (Index n = begin; n < end; ++n) {
          const S* d_v = d_directions.row(n);
          const Seen s = seen(transforms.row(n), points.row(n), center.data);
          if (!s.direction.usable) continue;  // L may hold what is no number: 0 times it would reach the centre
          Vector3<double> d_w = Vector3<double>::Zero();
          direction_adjoint(
              s.direction,
              Vector3<double>(static_cast<double>(d_v[0]), static_cast<double>(d_v[1]), static_cast<double>(d_v[2])),
              d_w);
          const Vector3<double> d_p = s.linear * d_w;
          sum += d_p;
          for (int i = 0; i < 3; ++i) {
            if (io.wants(kPoints)) io.d_in(kPoints).row(n)[i] += static_cast<S>(d_p[i]);
            for (int j = 0; j < 3 && io.wants(kTransforms); ++j) {
              io.d_in(kTransforms).row(n)[4 * i + j] += static_cast<S>(s.from_center[i] * d_w[j]);
            }
          }
        }
      });
      for (Index i = 0; i < 3; ++i) partials[static_cast<std::size_t>(i * part.chunks() + chunk)] = sum[i];
    });
    for (Index i = 0; i < 3 && io.wants(kCenter); ++i) {
      io.d_in(kCenter).data[i] -= static_cast<S>(pairwise_sum(partials.data() + i * part.chunks(), part.chunks()));
    }
  }
};

}  // namespace

template <class S>
Var<S> canonical_directions(Var<S> transforms, Var<S> points, Var<S> center, Source where) {
  const Index rows = points.shape().rows;
  HSI4D_CHECK_EQ(points.shape(), shape_of(rows, 3));
  HSI4D_CHECK_EQ(transforms.shape(), shape_of(rows, 12));
  HSI4D_CHECK_EQ(center.shape(), shape_of(1, 3));
  return points.owner().record(CanonicalDirectionsOp<S>{}, {transforms, points, center}, shape_of(rows, 3), where);
}

template Var<float> canonical_directions(Var<float>, Var<float>, Var<float>, Source);
template Var<double> canonical_directions(Var<double>, Var<double>, Var<double>, Source);

}  // namespace hsi4d
