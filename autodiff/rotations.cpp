#include "autodiff/rotations.h"

#include "core/parallel.h"
#include "core/rotation.h"
#include "core/rotation_6d.h"

namespace hsi4d {

namespace {

/// Rotations of one parallel chunk.
constexpr Index kRotationGrain = 256;

template <class S>
Vector3<S> vector_at(const S* x) {
  return {x[0], x[1], x[2]};
}

template <class S>
Matrix3<S> matrix_at(const S* x) {
  Matrix3<S> m;
  m << x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7], x[8];
  return m;
}

template <class S>
void put_matrix(const Matrix3<S>& m, S* x) {
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) x[3 * r + c] = m(r, c);
  }
}

/// R = exp(w)
template <class S>
struct RotationsFromAxisAngle {
  static constexpr const char* kName = "rotations_from_axis_angle";

  void forward(NodeIo<S>& io) {
    const ConstArray<S> w = io.in(0);
    const Array<S> r = io.out();
    parallel_for(w.shape.rows, kRotationGrain, [&](Index begin, Index end) {
      for (Index j = begin; j < end; ++j) put_matrix(so3_exp(vector_at(w.row(j))), r.row(j));
    });
  }

  void backward(NodeIo<S>& io) {
    const ConstArray<S> w = io.in(0), d_r = io.d_out();
    const Array<S> d_w = io.d_in(0);
    parallel_for(w.shape.rows, kRotationGrain, [&](Index begin, Index end) {
      for (Index j = begin; j < end; ++j) {
        Vector3<S> d = Vector3<S>::Zero();
        so3_exp_adjoint(vector_at(w.row(j)), matrix_at(d_r.row(j)), d);
        for (int i = 0; i < 3; ++i) d_w.row(j)[i] += d[i];
      }
    });
  }
};

/// R = [b1 b2 b3](a, b)
template <class S>
struct RotationsFrom6d {
  static constexpr const char* kName = "rotations_from_6d";

  void forward(NodeIo<S>& io) {
    const ConstArray<S> x = io.in(0);
    const Array<S> r = io.out();
    parallel_for(x.shape.rows, kRotationGrain, [&](Index begin, Index end) {
      for (Index j = begin; j < end; ++j) {
        put_matrix(rotation_from_6d(vector_at(x.row(j)), vector_at(x.row(j) + 3)), r.row(j));
      }
    });
  }

  void backward(NodeIo<S>& io) {
    const ConstArray<S> x = io.in(0), d_r = io.d_out();
    const Array<S> d_x = io.d_in(0);
    parallel_for(x.shape.rows, kRotationGrain, [&](Index begin, Index end) {
      for (Index j = begin; j < end; ++j) {
        Vector3<S> d_a = Vector3<S>::Zero(), d_b = Vector3<S>::Zero();
        rotation_from_6d_adjoint(vector_at(x.row(j)), vector_at(x.row(j) + 3), matrix_at(d_r.row(j)), d_a, d_b);
        for (int i = 0; i < 3; ++i) {
          d_x.row(j)[i] += d_a[i];
          d_x.row(j)[3 + i] += d_b[i];
        }
      }
    });
  }

  void add_signature(Signature& signature, NodeIo<S>& io) {
    const ConstArray<S> x = io.in(0);
    for (Index j = 0; j < x.shape.rows; ++j) {
      bool degenerate = false;
      rotation_from_6d(vector_at(x.row(j)), vector_at(x.row(j) + 3), &degenerate);
      signature.add(degenerate ? 1 : 0);
    }
  }
};

/// w = log R
template <class S>
struct AxisAngleFromRotations {
  static constexpr const char* kName = "axis_angle_from_rotations";

  void forward(NodeIo<S>& io) {
    const ConstArray<S> r = io.in(0);
    const Array<S> w = io.out();
    parallel_for(r.shape.rows, kRotationGrain, [&](Index begin, Index end) {
      for (Index j = begin; j < end; ++j) {
        const Vector3<S> x = so3_log(matrix_at(r.row(j)));
        for (int i = 0; i < 3; ++i) w.row(j)[i] = x[i];
      }
    });
  }

  void backward(NodeIo<S>& io) {
    const ConstArray<S> r = io.in(0), d_w = io.d_out();
    const Array<S> d_r = io.d_in(0);
    parallel_for(r.shape.rows, kRotationGrain, [&](Index begin, Index end) {
      for (Index j = begin; j < end; ++j) {
        Matrix3<S> d = Matrix3<S>::Zero();
        so3_log_adjoint(matrix_at(r.row(j)), vector_at(d_w.row(j)), d);
        for (int row = 0; row < 3; ++row) {
          for (int c = 0; c < 3; ++c) d_r.row(j)[3 * row + c] += d(row, c);
        }
      }
    });
  }

  void add_signature(Signature& signature, NodeIo<S>& io) {
    const ConstArray<S> r = io.in(0);
    for (Index j = 0; j < r.shape.rows; ++j) {
      const auto pivot = detail::pivot_quaternion(matrix_at(r.row(j)));
      signature.add(2 * static_cast<std::uint64_t>(pivot.pivot) + (detail::hemisphere(pivot.q) > 0 ? 1 : 0));
    }
  }
};

}  // namespace

template <class S>
Var<S> axis_angle_from_rotations(Var<S> rotations, Source where) {
  const Index joints = rotations.shape().rows;
  HSI4D_CHECK_EQ(rotations.shape(), shape_of(joints, 9));
  return rotations.owner().record(AxisAngleFromRotations<S>{}, {rotations}, shape_of(joints, 3), where);
}

template <class S>
Var<S> rotations_from_axis_angle(Var<S> axis_angle, Source where) {
  const Index joints = axis_angle.shape().rows;
  HSI4D_CHECK_EQ(axis_angle.shape(), shape_of(joints, 3));
  return axis_angle.owner().record(RotationsFromAxisAngle<S>{}, {axis_angle}, shape_of(joints, 9), where);
}

template <class S>
Var<S> rotations_from_6d(Var<S> columns, Source where) {
  const Index joints = columns.shape().rows;
  HSI4D_CHECK_EQ(columns.shape(), shape_of(joints, 6));
  return columns.owner().record(RotationsFrom6d<S>{}, {columns}, shape_of(joints, 9), where);
}

#define HSI4D_INSTANTIATE(S)                                 \
  template Var<S> rotations_from_axis_angle(Var<S>, Source); \
  template Var<S> rotations_from_6d(Var<S>, Source);         \
  template Var<S> axis_angle_from_rotations(Var<S>, Source);
HSI4D_INSTANTIATE(float)
HSI4D_INSTANTIATE(double)
#undef HSI4D_INSTANTIATE

}  // namespace hsi4d
