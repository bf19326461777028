#include "body/natural_pose.h"

#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "autodiff/elementwise.h"
#include "autodiff/matrix.h"
#include "autodiff/rotations.h"
#include "body/vposer.h"
#include "core/parallel.h"
#include "core/rotation.h"

namespace hsi4d {

namespace {

constexpr int kX = 0, kY = 1;
constexpr double kRadians = std::numbers::pi / 180;
constexpr Index kJointGrain = 64;

/// Left limbs and the trunk; degrees. A name without its side.
struct OneSide {
  const char* left;
  const char* right;  // null: in the middle
  NaturalJoint joint;
};

// clang-format off
constexpr NaturalJoint kLeftHip   = {"left_hip",      kY, {-12,   0,   3}, {24, 12, 10}, {-130,  -45, -35}, { 35,  55,  60}};
constexpr NaturalJoint kSpine1    = {"spine1",        kY, {  4,   0,   0}, {10,  8,  7}, { -30,  -30, -30}, { 50,  30,  30}};
constexpr NaturalJoint kLeftKnee  = {"left_knee",     kY, { 20,   0,   0}, {28,  7,  5}, {  -8,  -25, -15}, {155,  30,  15}};
constexpr NaturalJoint kSpine2    = {"spine2",        kY, {  3,   0,   0}, { 7,  7,  5}, { -25,  -30, -25}, { 40,  30,  25}};
constexpr NaturalJoint kLeftAnkle = {"left_ankle",    kY, { -4,   0,   0}, {12, 10,  8}, { -40,  -35, -35}, { 55,  35,  25}};
constexpr NaturalJoint kSpine3    = {"spine3",        kY, {  0,   0,   0}, { 6,  7,  5}, { -25,  -30, -25}, { 35,  30,  25}};
constexpr NaturalJoint kLeftFoot  = {"left_foot",     kY, {  0,   0,   0}, {10,  4,  4}, { -70,  -15, -15}, { 45,  15,  15}};
constexpr NaturalJoint kNeckLimits      = {"neck",          kY, {  5,   0,   0}, {12, 13,  9}, { -50,  -55, -40}, { 50,  55,  40}};
constexpr NaturalJoint kCollar    = {"left_collar",   kX, {  0,  -4,  -6}, { 7,  8,  8}, { -30,  -35, -25}, { 30,  30,  40}};
constexpr NaturalJoint kHeadLimits      = {"head",          kY, {  0,   0,   0}, {11, 13,  8}, { -45,  -50, -40}, { 40,  50,  40}};
constexpr NaturalJoint kShoulder  = {"left_shoulder", kX, {  8, -14, -56}, {25, 25, 24}, {-100, -140,-110}, { 95,  60, 100}};
constexpr NaturalJoint kElbow     = {"left_elbow",    kX, {  0, -34,   0}, {20, 32,  9}, { -95, -155, -25}, { 95,  10,  25}};
constexpr NaturalJoint kWrist     = {"left_wrist",    kX, {  0,   0,   0}, {20, 11, 16}, { -80,  -30, -80}, { 80,  45,  80}};
// clang-format on

/// The other side of a limb: y and z turn the other way.
constexpr NaturalJoint mirrored(NaturalJoint joint, const char* name) {
  joint.name = name;
  for (const int i : {1, 2}) {
    joint.ease[i] = -joint.ease[i];
    const double low = joint.low[i];
    joint.low[i] = -joint.high[i];
    joint.high[i] = -low;
  }
  return joint;
}

constexpr NaturalJoint kPosedJoints[] = {
    kLeftHip,
    mirrored(kLeftHip, "right_hip"),
    kSpine1,
    kLeftKnee,
    mirrored(kLeftKnee, "right_knee"),
    kSpine2,
    kLeftAnkle,
    mirrored(kLeftAnkle, "right_ankle"),
    kSpine3,
    kLeftFoot,
    mirrored(kLeftFoot, "right_foot"),
    kNeckLimits,
    kCollar,
    mirrored(kCollar, "right_collar"),
    kHeadLimits,
    kShoulder,
    mirrored(kShoulder, "right_shoulder"),
    kElbow,
    mirrored(kElbow, "right_elbow"),
    kWrist,
    mirrored(kWrist, "right_wrist"),
};
static_assert(std::size(kPosedJoints) == kBodyPoseJoints);

const NaturalJoint& joint_of_row(Index row) { return kPosedJoints[static_cast<std::size_t>(row % kBodyPoseJoints)]; }

Matrix3<double> rotation_at_ease(const NaturalJoint& joint) {
  return so3_exp(Vector3<double>(joint.ease[0] * kRadians, joint.ease[1] * kRadians, joint.ease[2] * kRadians));
}

template <class S>
Matrix3<S> rotation_at(const S* x) {
  Matrix3<S> m;
  m << x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7], x[8];
  return m;
}

/// y_r = M_j x_r (or M_jᵀ x_r), j = r mod 21.   d_x += M_jᵀ d_y.
template <class S>
struct TurnRows {
  static constexpr const char* kName = "turn_rows";
  std::array<Matrix3<S>, kBodyPoseJoints> turns;

  void forward(NodeIo<S>& io) {
    const ConstArray<S> x = io.in(0);
    const Array<S> y = io.out();
    for (Index r = 0; r < x.shape.rows; ++r) {
      const Matrix3<S> m = turns[static_cast<std::size_t>(r % kBodyPoseJoints)] * rotation_at(x.row(r));
      for (int i = 0; i < 9; ++i) y.row(r)[i] = m(i / 3, i % 3);
    }
  }
  void backward(NodeIo<S>& io) {
    const ConstArray<S> d_y = io.d_out();
    const Array<S> d_x = io.d_in(0);
    for (Index r = 0; r < d_x.shape.rows; ++r) {
      const Matrix3<S> m = turns[static_cast<std::size_t>(r % kBodyPoseJoints)].transpose() * rotation_at(d_y.row(r));
      for (int i = 0; i < 9; ++i) d_x.row(r)[i] += m(i / 3, i % 3);
    }
  }
};

template <class S>
Var<S> turned_rows(Var<S> rotations, bool by_inverse, const Source& where) {
  TurnRows<S> op;
  for (std::size_t j = 0; j < op.turns.size(); ++j) {
    const Matrix3<double> turn = rotation_at_ease(kPosedJoints[j]);
    op.turns[j] = (by_inverse ? Matrix3<double>(turn.transpose()) : turn).template cast<S>();
  }
  return rotations.owner().record(std::move(op), {rotations}, rotations.shape(), where);
}

/// [1,63]: the spread of every number, or 1/spread; radians.
template <class S>
Var<S> spreads(Tape<S>& tape, bool inverse, const Source& where) {
  const Var<S> var = tape.constant("spread", shape_of(1, 3 * kBodyPoseJoints), where);
  std::vector<S> numbers;
  for (const NaturalJoint& joint : kPosedJoints) {
    for (const double spread : joint.spread) {
      numbers.push_back(static_cast<S>(inverse ? 1 / (spread * kRadians) : spread * kRadians));
    }
  }
  tape.set(var, numbers);
  return var;
}

/// Twist and swing of a rotation, and what their adjoint needs. Axes i, j, k with k the bone's, in cyclic order.
struct TwistSwing {
  Vector4<double> q;  // w ≥ 0
  int i, j, k;
  double w, s, n;          // n² = w² + s²
  double cosine, sine;     // of half the twist
  double u_i, u_j, m;      // m = |u|
  double ratio;            // 2 atan2(m, n) / m
  Vector3<double> angles;  // about x, y, z
  bool has_twist;
};

/// (2n/(m² + n²) − ρ)/m², the slope of ρ = 2 atan2(m, n)/m by m, over m: by its series in (m/n)² where that cancels.
double ratio_slope(double m, double n, double ratio) {
  const double t2 = n > 0 ? (m / n) * (m / n) : 1;
  if (t2 > 0.01) return (2 * n / (m * m + n * n) - ratio) / (m * m);
  double sum = 0, power = 1;
  for (int p = 1; p <= 9; ++p) {
    const double term = power * (1 - 1.0 / (2 * p + 1));
    sum += p % 2 == 1 ? -term : term;
    power *= t2;
  }
  return 2 * sum / (n * n * n);
}

TwistSwing twist_swing(const Matrix3<double>& rotation, int twist_axis) {
  TwistSwing t;
  t.q = quaternion_from_matrix(rotation);
  if (!rotation.allFinite())
    t.q.setConstant(std::numeric_limits<double>::quiet_NaN());  // not the identity, a fine pose
  t.k = twist_axis;
  t.i = (t.k + 1) % 3;
  t.j = (t.k + 2) % 3;
  t.w = t.q[0];
  t.s = t.q[1 + t.k];
  t.u_i = t.q[1 + t.i];
  t.u_j = t.q[1 + t.j];
  t.m = std::hypot(t.u_i, t.u_j);
  t.n = std::hypot(t.w, t.s);
  t.has_twist = t.n >= kLeastTwist;
  t.cosine = t.has_twist ? t.w / t.n : 1;
  t.sine = t.has_twist ? t.s / t.n : 0;
  t.ratio = t.m <= 1e-12 * t.n ? 2 / t.n : 2 * std::atan2(t.m, t.n) / t.m;
  t.angles[t.k] = t.has_twist ? 2 * std::atan2(t.s, t.w) : 0;
  t.angles[t.i] = t.ratio * (t.cosine * t.u_i - t.sine * t.u_j);
  t.angles[t.j] = t.ratio * (t.cosine * t.u_j + t.sine * t.u_i);
  return t;
}

/// d_R of cotangents g of the three angles.
Matrix3<double> twist_swing_adjoint(const Matrix3<double>& rotation, const TwistSwing& t, const Vector3<double>& g) {
  const double d_pi = t.ratio * g[t.i], d_pj = t.ratio * g[t.j];
  const double d_ratio = (g[t.i] * t.angles[t.i] + g[t.j] * t.angles[t.j]) / t.ratio;
  const double by_m = d_ratio * ratio_slope(t.m, t.n, t.ratio);
  Vector4<double> d_q = Vector4<double>::Zero();
  d_q[1 + t.i] = t.cosine * d_pi + t.sine * d_pj + by_m * t.u_i;
  d_q[1 + t.j] = t.cosine * d_pj - t.sine * d_pi + by_m * t.u_j;
  if (t.has_twist) {
    const double n2 = t.n * t.n;
    const double d_cosine = d_pi * t.u_i + d_pj * t.u_j, d_sine = d_pj * t.u_i - d_pi * t.u_j;
    const double d_n = d_ratio * (-2 / (t.m * t.m + n2));
    const double across = (d_sine * t.cosine - d_cosine * t.sine) / t.n + 2 * g[t.k] / t.n;
    d_q[0] += d_n * t.cosine - across * t.sine;
    d_q[1 + t.k] += d_n * t.sine + across * t.cosine;
  }
  Matrix3<double> d_rotation = Matrix3<double>::Zero();
  quaternion_from_matrix_adjoint(rotation, d_q, d_rotation);
  return d_rotation;
}

/// How far angle x is beyond_limit its range; below it, negative; NaN for NaN, which is within no range.
double beyond_limit(const NaturalJoint& joint, int axis, double x) {
  const double low = joint.low[axis] * kRadians, high = joint.high[axis] * kRadians;
  return x > high ? x - high : x >= low ? 0 : x - low;
}

template <class S>
struct JointLimitExcess {
  static constexpr const char* kName = "joint_limit_excess";

  static Matrix3<double> rotation_of(const ConstArray<S>& rotations, Index row) {
    return rotation_at(rotations.row(row)).template cast<double>();
  }

  void forward(NodeIo<S>& io) {
    const ConstArray<S> r = io.in(0);
    const Array<S> y = io.out();
    parallel_for(r.shape.rows, kJointGrain, [&](Index begin, Index end) {
      for (Index row = begin; row < end; ++row) {
        const NaturalJoint& joint = joint_of_row(row);
        const TwistSwing t = twist_swing(rotation_of(r, row), joint.twist_axis);
        double sum = 0;
        for (int axis = 0; axis < 3; ++axis) {
          const double x = beyond_limit(joint, axis, t.angles[axis]);
          sum += x * x;
        }
        *y.row(row) = static_cast<S>(sum);
      }
    });
  }

  void backward(NodeIo<S>& io) {
    const ConstArray<S> r = io.in(0), d_y = io.d_out();
    const Array<S> d_r = io.d_in(0);
    parallel_for(r.shape.rows, kJointGrain, [&](Index begin, Index end) {
      for (Index row = begin; row < end; ++row) {
        const NaturalJoint& joint = joint_of_row(row);
        const Matrix3<double> rotation = rotation_of(r, row);
        const TwistSwing t = twist_swing(rotation, joint.twist_axis);
        Vector3<double> g;
        for (int axis = 0; axis < 3; ++axis)
          g[axis] = 2 * beyond_limit(joint, axis, t.angles[axis]) * static_cast<double>(*d_y.row(row));
        if (g == Vector3<double>::Zero()) continue;
        const Matrix3<double> d = twist_swing_adjoint(rotation, t, g);
        for (int i = 0; i < 9; ++i) d_r.row(row)[i] += static_cast<S>(d(i / 3, i % 3));
      }
    });
  }

  void add_signature(Signature& signature, NodeIo<S>& io) {
    const ConstArray<S> r = io.in(0);
    for (Index row = 0; row < r.shape.rows; ++row) {
      const Matrix3<double> rotation = rotation_of(r, row);
      const auto pivot = detail::pivot_quaternion(rotation);
      const bool has_twist = twist_swing(rotation, joint_of_row(row).twist_axis).has_twist;
      signature.add(4 * static_cast<std::uint64_t>(pivot.pivot) + (detail::hemisphere(pivot.q) > 0 ? 2 : 0) +
                    (has_twist ? 1 : 0));
    }
  }
};

template <class S>
Index frames_of(Var<S> rotations) {
  const Index frames = rotations.shape().rows / kBodyPoseJoints;
  HSI4D_CHECK_EQ(rotations.shape(), shape_of(kBodyPoseJoints * frames, 9));
  return frames;
}

}  // namespace

std::span<const NaturalJoint> natural_joints() { return kPosedJoints; }

template <class S>
Var<S> natural_decode(Var<S> latents, Source where) {
  const Index frames = latents.shape().rows;
  HSI4D_CHECK_EQ(latents.shape(), shape_of(frames, 3 * kBodyPoseJoints));
  const Var<S> vectors =
      reshape(latents * Operand<S>(spreads(latents.owner(), false, where), where), kBodyPoseJoints * frames, 3, where);
  return turned_rows(rotations_from_axis_angle(vectors, where), false, where);
}

template <class S>
Var<S> natural_encode(Var<S> rotations, Source where) {
  const Index frames = frames_of(rotations);
  const Var<S> vectors = axis_angle_from_rotations(turned_rows(rotations, true, where), where);
  return reshape(vectors, frames, 3 * kBodyPoseJoints, where) *
         Operand<S>(spreads(rotations.owner(), true, where), where);
}

template <class S>
Var<S> joint_limit_excess(Var<S> rotations, Source where) {
  const Index rows = kBodyPoseJoints * frames_of(rotations);
  return rotations.owner().record(JointLimitExcess<S>{}, {rotations}, shape_of(rows, 1), where);
}

Vector3<double> twist_and_swing(const Matrix3<double>& rotation, int twist_axis) {
  return twist_swing(rotation, twist_axis).angles;
}

#define HSI4D_INSTANTIATE(S)                      \
  template Var<S> natural_decode(Var<S>, Source); \
  template Var<S> natural_encode(Var<S>, Source); \
  template Var<S> joint_limit_excess(Var<S>, Source);
HSI4D_INSTANTIATE(float)
HSI4D_INSTANTIATE(double)
#undef HSI4D_INSTANTIATE

}  // namespace hsi4d
