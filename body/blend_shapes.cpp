#include "body/blend_shapes.h"

#include <algorithm>
#include <cmath>

#include "core/parallel.h"
#include "core/rotation.h"
#include "core/simd.h"

namespace hsi4d {

namespace {

/// Σ |R_ik − δ_ik| is at most 3 ‖R − I‖ = 3 √(4 − 4 cos θ).
constexpr double kOffsetReach = 8.4853;

/// Adds Pᵀ d_result to d_coefficients, or assigns it.
template <class S>
void add_gathered(NodeIo<S>& io, const Directions<S>& directions, bool assign, S* d_coefficients) {
  S* scratch = io.scratch(gather_scratch(directions)).data();
  double* sums = io.template scratch<double>(directions.columns()).data();
  gather_directions(directions, io.d_out().data, scratch, sums);
  for (Index c = 0; c < directions.columns(); ++c) {
    d_coefficients[c] = assign ? static_cast<S>(sums[c]) : d_coefficients[c] + static_cast<S>(sums[c]);
  }
}

template <class S>
struct BlendShapes {
  static constexpr const char* kName = "blend_shapes";
  std::vector<S> rest;
  std::vector<Directions<S>> directions;

  void forward(NodeIo<S>& io) {
    const S* points = rest.data();
    for (std::size_t k = 0; k < directions.size(); ++k) {
      add_directions(directions[k], io.in(static_cast<int>(k)).data, points, io.out().data);
      points = io.out().data;
    }
  }

  void backward(NodeIo<S>& io) {
    for (std::size_t k = 0; k < directions.size(); ++k) {
      const int input = static_cast<int>(k);
      if (!io.wants(input)) continue;
      add_gathered(io, directions[k], false, io.d_in(input).data);
    }
  }
};

template <class S>
struct PoseCorrectives {
  static constexpr const char* kName = "pose_correctives";
  static constexpr bool kAssigns = true;
  Directions<S> directions;

  void forward(NodeIo<S>& io) { add_directions(directions, io.in(0).data, io.in(1).data, io.out().data); }

  void backward(NodeIo<S>& io) {
    if (io.wants(0)) add_gathered(io, directions, io.must_assign(0), io.d_in(0).data);
    if (!io.wants(1)) return;
    const S* d_result = io.d_out().data;
    S* d_points = io.d_in(1).data;
    const bool assign = io.must_assign(1);
    on_best_isa([&] {
      for (Index i = 0; i < 3 * directions.vertices(); ++i)
        d_points[i] = assign ? d_result[i] : d_points[i] + d_result[i];
    });
  }
};

template <class S>
Vector3<S> vector_at(const S* x) {
  return {x[0], x[1], x[2]};
}

template <class S>
struct RotationOffsetsFromAxisAngle {
  static constexpr const char* kName = "rotation_offsets_from_axis_angle";

  void forward(NodeIo<S>& io) {
    for (Index j = 0; j < io.in(0).shape.rows; ++j) {
      const Matrix3<S> m = so3_exp_minus_identity(vector_at(io.in(0).row(j)));
      for (int i = 0; i < 9; ++i) io.out().row(j)[i] = m(i / 3, i % 3);
    }
  }

  void backward(NodeIo<S>& io) {
    for (Index j = 0; j < io.in(0).shape.rows; ++j) {
      Matrix3<S> d_rotation;
      for (int i = 0; i < 9; ++i) d_rotation(i / 3, i % 3) = io.d_out().row(j)[i];
      Vector3<S> d = Vector3<S>::Zero();
      so3_exp_adjoint(vector_at(io.in(0).row(j)), d_rotation, d);
      for (int i = 0; i < 3; ++i) io.d_in(0).row(j)[i] += d[i];
    }
  }
};

template <class S>
struct RotationOffsets {
  static constexpr const char* kName = "rotation_offsets";

  void forward(NodeIo<S>& io) {
    for (Index j = 0; j < io.in(0).shape.rows; ++j) {
      for (int i = 0; i < 9; ++i) io.out().row(j)[i] = io.in(0).row(j)[i] - S(i % 4 == 0 ? 1 : 0);
    }
  }

  void backward(NodeIo<S>& io) {
    const S* d_offsets = io.d_out().data;
    S* d_rotations = io.d_in(0).data;
    for (Index i = 0; i < io.in(0).shape.count(); ++i) d_rotations[i] += d_offsets[i];
  }
};

}  // namespace

template <class S>
Var<S> blend_shapes(std::span<const double> rest, std::span<const BlendTerm<S>> terms, Source where) {
  HSI4D_CHECK(!terms.empty(), "nothing to blend");
  BlendShapes<S> op{std::vector<S>(rest.begin(), rest.end()), {}};
  std::vector<Var<S>> inputs;
  for (const BlendTerm<S>& term : terms) {
    HSI4D_CHECK_EQ(3 * term.directions.vertices(), static_cast<Index>(rest.size()));
    HSI4D_CHECK_EQ(term.coefficients.shape(), shape_of(1, term.directions.columns()));
    op.directions.push_back(term.directions);
    inputs.push_back(term.coefficients);
  }
  const Shape shape = shape_of(static_cast<Index>(rest.size()) / 3, 3);
  Tape<S>& tape = inputs.front().owner();
  return tape.record(std::move(op), inputs, std::span(&shape, 1), where);
}

template <class S>
PoseDirections<S>::PoseDirections(std::span<const double> values, Index vertices, Index first, Index count,
                                  double packing) {
  HSI4D_CHECK(vertices >= 1 && values.size() % static_cast<std::size_t>(27 * vertices) == 0,
              "correctives do not fit the vertices");
  const Index joints = static_cast<Index>(values.size()) / (27 * vertices) + 1;
  HSI4D_CHECK(first >= 1 && count >= 1 && first + count <= joints, "joints that have no correctives");
  DirectionSource source{values, vertices, 9 * (joints - 1), {}, 9};
  for (Index joint = first; joint < first + count; ++joint) source.group_begin.push_back(9 * (joint - 1));
  directions_ = Directions<S>(source, {packing, kOffsetReach});
}

template <class S>
Var<S> pose_correctives(const PoseDirections<S>& directions, Var<S> offsets, Var<S> points, Source where) {
  HSI4D_CHECK_EQ(offsets.shape(), shape_of(directions.joints(), 9));
  HSI4D_CHECK_EQ(points.shape(), shape_of(directions.vertices(), 3));
  return offsets.owner().record(PoseCorrectives<S>{directions.directions()}, {offsets, points}, points.shape(), where);
}

template <class S>
Var<S> rotation_offsets_from_axis_angle(Var<S> axis_angle, Source where) {
  const Index joints = axis_angle.shape().rows;
  HSI4D_CHECK_EQ(axis_angle.shape(), shape_of(joints, 3));
  return axis_angle.owner().record(RotationOffsetsFromAxisAngle<S>{}, {axis_angle}, shape_of(joints, 9), where);
}

template <class S>
Var<S> rotation_offsets(Var<S> rotations, Source where) {
  const Index joints = rotations.shape().rows;
  HSI4D_CHECK_EQ(rotations.shape(), shape_of(joints, 9));
  return rotations.owner().record(RotationOffsets<S>{}, {rotations}, shape_of(joints, 9), where);
}

#define HSI4D_INSTANTIATE(S)                                                                    \
  template Var<S> blend_shapes(std::span<const double>, std::span<const BlendTerm<S>>, Source); \
  template class PoseDirections<S>;                                                             \
  template Var<S> pose_correctives(const PoseDirections<S>&, Var<S>, Var<S>, Source);           \
  template Var<S> rotation_offsets_from_axis_angle(Var<S>, Source);                             \
  template Var<S> rotation_offsets(Var<S>, Source);
HSI4D_INSTANTIATE(float)
HSI4D_INSTANTIATE(double)
#undef HSI4D_INSTANTIATE

}  // namespace hsi4d
