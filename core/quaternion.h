// Quaternions, stored w, x, y, z (Hamilton's product: ij = k). q and −q are the same rotation.
//
// A quaternion that is a parameter is "raw": any length, normalised by the function that reads it, so that its gradient
// is orthogonal to it (row A13). A zero or non-finite one stands for the identity, has no gradient and is reported by
// the `degenerate` flag, for the caller to count (row C8: zero quaternion).
#pragma once

#include "core/lanes.h"
#include "core/linear.h"
#include "core/stumpff.h"

namespace hsi4d {

namespace detail {

/// The direction of a raw quaternion; the identity if there is none.
template <class S>
Direction<S, 4> quaternion_direction(const Vector4<S>& q, bool* degenerate) {
  Direction<S, 4> direction = direction_of(q);
  if (!direction.usable) direction.unit = Vector4<S>(S(1), S(0), S(0), S(0));
  if (degenerate != nullptr) *degenerate = !direction.usable;
  return direction;
}

/// +1 or −1, so that q and −q times their own sign are the same numbers: w ≥ 0, and where w = 0 (half a turn) the first
/// component that is not 0 is positive.
template <class S>
Real<S> hemisphere(const Vector4<S>& q) {
  for (int i = 0; i < 4; ++i) {
    if (real_part(q[i]) != 0) return real_part(q[i]) > 0 ? Real<S>(1) : Real<S>(-1);
  }
  return 1;
}

/// 4 q_p q from a rotation matrix, p the largest component of q: no square root, nothing cancels. [Shepperd 1978]
template <class S>
struct PivotQuaternion {
  Vector4<S> q;
  int pivot;
};

template <class S>
PivotQuaternion<S> pivot_quaternion(const Matrix3<S>& r) {
  const S trace = r(0, 0) + r(1, 1) + r(2, 2);
  int pivot = 0;
  Real<S> largest = real_part(trace);
  for (int i = 0; i < 3; ++i) {
    if (real_part(r(i, i)) > largest) largest = real_part(r(i, i)), pivot = i + 1;
  }
  if (pivot == 0) return {{S(1) + trace, r(2, 1) - r(1, 2), r(0, 2) - r(2, 0), r(1, 0) - r(0, 1)}, 0};
  const int i = pivot - 1, j = pivot % 3, k = (pivot + 1) % 3;
  PivotQuaternion<S> result{{}, pivot};
  result.q[0] = r(k, j) - r(j, k);
  result.q[1 + i] = S(1) + r(i, i) - r(j, j) - r(k, k);
  result.q[1 + j] = r(i, j) + r(j, i);
  result.q[1 + k] = r(i, k) + r(k, i);
  return result;
}

template <class S>
void pivot_quaternion_adjoint(int pivot, const Vector4<S>& d_q, Matrix3<S>& d_r) {
  if (pivot == 0) {
    d_r += hat(Vector3<S>(d_q[1], d_q[2], d_q[3]));
    for (int i = 0; i < 3; ++i) d_r(i, i) += d_q[0];
    return;
  }
  const int i = pivot - 1, j = pivot % 3, k = (pivot + 1) % 3;
  d_r(k, j) += d_q[0], d_r(j, k) -= d_q[0];
  d_r(i, i) += d_q[1 + i], d_r(j, j) -= d_q[1 + i], d_r(k, k) -= d_q[1 + i];
  d_r(i, j) += d_q[1 + j], d_r(j, i) += d_q[1 + j];
  d_r(i, k) += d_q[1 + k], d_r(k, i) += d_q[1 + k];
}

/// Log of a quaternion that is near unit length and on the hemisphere w ≥ 0.
template <class S>
Vector3<S> scaled_quaternion_log(const Vector4<S>& q) {
  using std::sqrt;
  const Vector3<S> v(q[1], q[2], q[3]);
  const S length = sqrt(dot(v, v));
  // Below, the angle is 2 |v| / w to rounding, and dividing by |v| could be 0/0.
  const bool tiny = real_part(length) <= std::numeric_limits<Real<S>>::epsilon() * real_part(q[0]);
  const S scale = tiny ? S(2) / q[0] : S(2) * angle_of(length, q[0]) / length;
  return v * scale;
}

template <class S>
void scaled_quaternion_log_adjoint(const Vector4<S>& q, const Vector3<S>& d_axis_angle, Vector4<S>& d_q) {
  using std::sqrt;
  const Vector3<S> v(q[1], q[2], q[3]);
  const S length = sqrt(dot(v, v));
  if (real_part(length) <= std::numeric_limits<Real<S>>::epsilon() * real_part(q[0])) {
    for (int i = 0; i < 3; ++i) d_q[1 + i] += d_axis_angle[i] * (S(2) / q[0]);
    d_q[0] -= S(2) * dot(v, d_axis_angle) / (q[0] * q[0]);
    return;
  }
  const S squared = length * length + q[0] * q[0];
  const Vector3<S> axis = v / length;
  const S along = dot(axis, d_axis_angle);
  const S across_scale = S(2) * angle_of(length, q[0]) / length;
  const S along_scale = S(2) * q[0] / squared;
  for (int i = 0; i < 3; ++i) {
    d_q[1 + i] += across_scale * (d_axis_angle[i] - axis[i] * along) + along_scale * axis[i] * along;
  }
  d_q[0] -= S(2) * length / squared * along;
}

/// The rotation matrix r, by rows, of a unit quaternion. T: a number, or Lanes of them.
template <class T>
void unit_quaternion_to_matrix(const T* q, T* r) {
  const T x2 = q[1] + q[1], y2 = q[2] + q[2], z2 = q[3] + q[3];
  const T xx = q[1] * x2, yy = q[2] * y2, zz = q[3] * z2;
  const T xy = q[1] * y2, xz = q[1] * z2, yz = q[2] * z2;
  const T wx = q[0] * x2, wy = q[0] * y2, wz = q[0] * z2;
  const T one = lane_constant<T>(1);
  r[0] = one - (yy + zz), r[1] = xy - wz, r[2] = xz + wy;
  r[3] = xy + wz, r[4] = one - (xx + zz), r[5] = yz - wx;
  r[6] = xz - wy, r[7] = yz + wx, r[8] = one - (xx + yy);
}

/// Its gradient as a function of all four numbers: R = I + 2 w K(v) + 2 (v vᵀ − |v|² I).
///
/// @param d_r  of the matrix, by rows
template <class T>
void unit_quaternion_gradient(const T* q, const T* d_r, T* d_q) {
  const T* const v = q + 1;
  const T turn[3] = {d_r[7] - d_r[5], d_r[2] - d_r[6], d_r[3] - d_r[1]};
  const T trace = d_r[0] + d_r[4] + d_r[8];
  const T two = lane_constant<T>(2);
  d_q[0] = (v[0] * turn[0] + v[1] * turn[1] + v[2] * turn[2]) * two;
  for (int i = 0; i < 3; ++i) {
    const T symmetric =
        (d_r[3 * i] + d_r[i]) * v[0] + (d_r[3 * i + 1] + d_r[3 + i]) * v[1] + (d_r[3 * i + 2] + d_r[6 + i]) * v[2];
    d_q[1 + i] = (turn[i] * q[0] + symmetric - v[i] * (trace + trace)) * two;
  }
}

/// A matrix by rows.
template <class S>
Eigen::Matrix<S, 3, 3, Eigen::RowMajor> unit_quaternion_to_matrix(const Vector4<S>& q) {
  Eigen::Matrix<S, 3, 3, Eigen::RowMajor> r;
  unit_quaternion_to_matrix(q.data(), r.data());
  return r;
}

template <class S>
Vector4<S> unit_quaternion_gradient(const Vector4<S>& q, const Matrix3<S>& d_r) {
  const Eigen::Matrix<S, 3, 3, Eigen::RowMajor> rows = d_r;
  Vector4<S> d_q;
  unit_quaternion_gradient(q.data(), rows.data(), d_q.data());
  return d_q;
}

}  // namespace detail

/// q / |q| for any length (row C8: zero quaternion). Adjoint: quaternion_normalized_adjoint.
///
/// @param q           raw quaternion
/// @param degenerate  set to whether q is zero or non-finite; the result is then the identity
template <class S>
Vector4<S> quaternion_normalized(const Vector4<S>& q, bool* degenerate = nullptr) {
  return detail::quaternion_direction(q, degenerate).unit;
}

/// d_q += (g − q̂ (q̂·g)) / |q|. None where q is degenerate or shorter than smallest_length() (1e-19 in float).
template <class S>
void quaternion_normalized_adjoint(const Vector4<S>& q, const Vector4<S>& d_normalized, Vector4<S>& d_q) {
  direction_adjoint(direction_of(q), d_normalized, d_q);
}

/// Rotation matrix of a raw quaternion, R = I + 2 w K + 2 K² at q/|q|, K = hat(x, y, z) (row A13: only the direction of
/// q counts).
///
/// @param q           raw quaternion
/// @param degenerate  set to whether q is zero or non-finite; the result is then the identity
/// Adjoint: quaternion_to_matrix_adjoint, orthogonal to q. None where q is degenerate or shorter than
/// smallest_length().
template <class S>
Matrix3<S> quaternion_to_matrix(const Vector4<S>& q, bool* degenerate = nullptr) {
  return detail::unit_quaternion_to_matrix(detail::quaternion_direction(q, degenerate).unit);
}

template <class S>
void quaternion_to_matrix_adjoint(const Vector4<S>& q, const Matrix3<S>& d_rotation, Vector4<S>& d_q) {
  const Direction<S, 4> direction = direction_of(q);
  direction_adjoint(direction, detail::unit_quaternion_gradient(direction.unit, d_rotation), d_q);
}

/// Unit quaternion of a rotation matrix by the largest pivot, w ≥ 0 (rows C5, C7, C10). [Shepperd 1978]
///
/// Adjoint: quaternion_from_matrix_adjoint, of the pivot's formula as a function of all nine entries. The sign jumps at
/// half a turn.
template <class S>
Vector4<S> quaternion_from_matrix(const Matrix3<S>& rotation) {
  const Vector4<S> q = detail::quaternion_direction(detail::pivot_quaternion(rotation).q, nullptr).unit;
  return q * S(detail::hemisphere(q));
}

template <class S>
void quaternion_from_matrix_adjoint(const Matrix3<S>& rotation, const Vector4<S>& d_q, Matrix3<S>& d_rotation) {
  const auto pivot = detail::pivot_quaternion(rotation);
  Vector4<S> d_pivot = Vector4<S>::Zero();
  direction_adjoint(direction_of(pivot.q), Vector4<S>(d_q * S(detail::hemisphere(pivot.q))), d_pivot);
  detail::pivot_quaternion_adjoint(pivot.pivot, d_pivot, d_rotation);
}

/// Hamilton product p q: the rotation q first, then p. Adjoint: quaternion_product_adjoint.
template <class S>
Vector4<S> quaternion_product(const Vector4<S>& p, const Vector4<S>& q) {
  return {p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3], p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
          p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1], p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0]};
}

/// Conjugate: the inverse rotation of a unit quaternion. Its own adjoint.
template <class S>
Vector4<S> quaternion_conjugate(const Vector4<S>& q) {
  return {q[0], -q[1], -q[2], -q[3]};
}

/// d_p += g q*, d_q += p* g: the product is bilinear and conjugation transposes it.
template <class S>
void quaternion_product_adjoint(const Vector4<S>& p, const Vector4<S>& q, const Vector4<S>& d_product, Vector4<S>& d_p,
                                Vector4<S>& d_q) {
  d_p += quaternion_product(d_product, quaternion_conjugate(q));
  d_q += quaternion_product(quaternion_conjugate(p), d_product);
}

/// Rotation of a point by a raw quaternion, R(q/|q|) point. Adjoint: quaternion_rotate_adjoint, both arguments.
template <class S>
Vector3<S> quaternion_rotate(const Vector4<S>& q, const Vector3<S>& point) {
  return quaternion_to_matrix(q) * point;
}

/// d_q as quaternion_to_matrix_adjoint of g pointᵀ, d_point += Rᵀ g.
template <class S>
void quaternion_rotate_adjoint(const Vector4<S>& q, const Vector3<S>& point, const Vector3<S>& d_rotated,
                               Vector4<S>& d_q, Vector3<S>& d_point) {
  quaternion_to_matrix_adjoint(q, Matrix3<S>(d_rotated * point.transpose()), d_q);
  d_point += quaternion_to_matrix(q).transpose() * d_rotated;
}

/// Axis-angle of a raw quaternion, 2 atan2(|v|, w) v/|v| with w ≥ 0, so |result| ≤ π and log(q) = log(−q) bit for bit
/// (row C7: q and −q).
///
/// @return  radians; zero for a degenerate quaternion
/// Adjoint: quaternion_log_adjoint. The result jumps at half a turn; no gradient where quaternion_to_matrix has none.
template <class S>
Vector3<S> quaternion_log(const Vector4<S>& q) {
  const Direction<S, 4> direction = direction_of(q);
  if (!direction.usable) return Vector3<S>::Zero();
  return detail::scaled_quaternion_log(Vector4<S>(direction.unit * S(detail::hemisphere(q))));
}

template <class S>
void quaternion_log_adjoint(const Vector4<S>& q, const Vector3<S>& d_axis_angle, Vector4<S>& d_q) {
  const Direction<S, 4> direction = direction_of(q);
  if (!direction.usable) return;
  const S sign(detail::hemisphere(q));
  Vector4<S> d_unit = Vector4<S>::Zero();
  detail::scaled_quaternion_log_adjoint(Vector4<S>(direction.unit * sign), d_axis_angle, d_unit);
  direction_adjoint(direction, Vector4<S>(d_unit * sign), d_q);
}

/// Unit quaternion of an axis-angle vector, (cos(t/2), w sin(t/2)/t). Adjoint: quaternion_exp_adjoint.
///
/// @param axis_angle  radians; smooth at 0
template <class S>
Vector4<S> quaternion_exp(const Vector3<S>& axis_angle) {
  using W = detail::Wide<S>;
  const Vector3<W> w = axis_angle.template cast<W>();
  const W x = dot(w, w) / W(4);
  const Stumpff<W> c = stumpff_12(x);
  const Vector3<W> v = w * (c.c1 / W(2));
  return Vector4<W>(W(1) - x * c.c2, v[0], v[1], v[2]).template cast<S>();
}

template <class S>
void quaternion_exp_adjoint(const Vector3<S>& axis_angle, const Vector4<S>& d_q, Vector3<S>& d_axis_angle) {
  using W = detail::Wide<S>;
  const Vector3<W> w = axis_angle.template cast<W>();
  const Stumpff<W> c = stumpff(W(dot(w, w) / W(4)));
  const Vector3<W> d_v{W(d_q[1]), W(d_q[2]), W(d_q[3])};
  // d(cos)/dx = −c1/2 and x = w·w/4
  const W d_x = (dot(w, d_v) * c.d_c1() - W(d_q[0]) * c.c1) / W(2);
  d_axis_angle += Vector3<W>(d_v * (c.c1 / W(2)) + w * (d_x / W(2))).template cast<S>();
}

/// Spherical interpolation, q0 (q0* q1)^u, along the shorter way (q1 and −q1 give the same rotations; row C7).
///
/// @param q0, q1   raw quaternions, normalised here
/// @param u        0 gives q0, 1 gives q1 or −q1
/// Adjoint: none. Half a turn apart the way is chosen by the sign rule of quaternion_log.
template <class S>
Vector4<S> slerp(const Vector4<S>& q0, const Vector4<S>& q1, const S& u) {
  const Vector4<S> start = quaternion_normalized(q0);
  const Vector4<S> step = quaternion_product(quaternion_conjugate(start), quaternion_normalized(q1));
  return quaternion_product(start, quaternion_exp(Vector3<S>(quaternion_log(step) * u)));
}

}  // namespace hsi4d
