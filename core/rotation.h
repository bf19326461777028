// Rotations in space, SO(3): exponential and logarithm of axis-angle vectors, and their Jacobians.
//
// With K = hat(w), t = |w| and the Stumpff functions c_k of t² (stumpff.h),
//
//   exp(w)            R  = I + c1 K + c2 K²
//   left Jacobian     J  = I + c2 K + c3 K²          exp(w + d) ≈ exp(J d) exp(w)
//   its inverse       J⁻¹ = I − K/2 + D K²,          D = (1 − (t/2) cot(t/2)) / t² = (c2 − c3)/(4 c1) at t²/4
//
// and the right Jacobians are their transposes (w → −w). K² = w wᵀ − t² I. All four are I + p K + q K² with p, q
// functions of t², so they share one adjoint: for a cotangent G of the matrix, a = axial(G), s = wᵀ G w − t² tr G,
//
//   d_w = p a + q ((G + Gᵀ) w − 2 tr(G) w) + 2 (p' (a·w) + q' s) w,
//
// which at w = 0 is p a: the gradient at the identity is the generators, neither 0 nor NaN (rows C1, C2: angle 0).
#pragma once

#include <cmath>
#include <numbers>

#include "core/linear.h"
#include "core/quaternion.h"
#include "core/stumpff.h"

namespace hsi4d {

namespace detail {

/// p and q of I + p K + q K², and their derivatives with respect to t².
template <class W>
struct HatPolynomial {
  W p, q, d_p, d_q;
};

/// p K + q K², entry by entry: nothing is subtracted from the diagonal (row D3: R − I).
template <class W>
Matrix3<W> hat_polynomial(const Vector3<W>& w, const W& p, const W& q) {
  const Vector3<W> pw = w * p;
  const Vector3<W> qw = w * q;
  const W xx = w[0] * qw[0], yy = w[1] * qw[1], zz = w[2] * qw[2];
  const W xy = w[0] * qw[1], xz = w[0] * qw[2], yz = w[1] * qw[2];
  Matrix3<W> m;
  m << -(yy + zz), xy - pw[2], xz + pw[1], xy + pw[2], -(xx + zz), yz - pw[0], xz - pw[1], yz + pw[0], -(xx + yy);
  return m;
}

/// I + p K + q K², rounded to S once.
template <class S, class W>
Matrix3<S> identity_plus(const Vector3<W>& w, const W& p, const W& q) {
  return Matrix3<W>(Matrix3<W>::Identity() + hat_polynomial(w, p, q)).template cast<S>();
}

template <class S, class W>
void hat_polynomial_adjoint(const Vector3<W>& w, const HatPolynomial<W>& c, const Matrix3<S>& d_matrix,
                            Vector3<S>& d_w) {
  const Matrix3<W> g = d_matrix.template cast<W>();
  const Vector3<W> turn = axial(g);
  const W trace = g(0, 0) + g(1, 1) + g(2, 2);
  const Vector3<W> gw = (g + g.transpose()) * w;
  const W d_square = dot(w, gw) / W(2) - dot(w, w) * trace;
  const W along = W(2) * (c.d_p * dot(turn, w) + c.d_q * d_square);
  d_w += Vector3<W>(turn * c.p + (gw - w * (W(2) * trace)) * c.q + w * along).template cast<S>();
}

/// D of the inverse Jacobian and its derivative with respect to t².
template <class W>
void inverse_jacobian_coefficient(const W& squared_angle, W& value, W& derivative) {
  const Stumpff<W> c = stumpff(W(squared_angle / W(4)));
  const W difference = c.c2 - c.c3;
  value = difference / (W(4) * c.c1);
  derivative = ((c.d_c2() - c.d_c3()) - difference * c.d_c1() / c.c1) / (W(16) * c.c1);
}

}  // namespace detail

/// exp(w) − I = c1 K + c2 K², accurate to rounding of its own size for small w (row D3: R − I).
///
/// @param axis_angle  radians
/// Adjoint: so3_exp_adjoint.
template <class S>
Matrix3<S> so3_exp_minus_identity(const Vector3<S>& axis_angle) {
  using W = detail::Wide<S>;
  const Vector3<W> w = axis_angle.template cast<W>();
  const Stumpff<W> c = stumpff_12(dot(w, w));
  return detail::hat_polynomial(w, c.c1, c.c2).template cast<S>();
}

/// Rotation matrix of an axis-angle vector, exp(w) = I + c1 K + c2 K² (Rodrigues; rows C1-C4: small angles).
///
/// @param axis_angle  radians, any angle; smooth at 0. Non-finite numbers give a non-finite matrix.
/// Adjoint: so3_exp_adjoint.
template <class S>
Matrix3<S> so3_exp(const Vector3<S>& axis_angle) {
  using W = detail::Wide<S>;
  const Vector3<W> w = axis_angle.template cast<W>();
  const Stumpff<W> c = stumpff_12(dot(w, w));
  return detail::identity_plus<S>(w, c.c1, c.c2);
}

/// Adjoint of so3_exp and of so3_exp_minus_identity.
template <class S>
void so3_exp_adjoint(const Vector3<S>& axis_angle, const Matrix3<S>& d_rotation, Vector3<S>& d_axis_angle) {
  using W = detail::Wide<S>;
  const Vector3<W> w = axis_angle.template cast<W>();
  const Stumpff<W> c = stumpff(dot(w, w));
  detail::hat_polynomial_adjoint<S>(w, {c.c1, c.c2, c.d_c1(), c.d_c2()}, d_rotation, d_axis_angle);
}

/// Axis-angle vector of a rotation matrix, by the largest pivot's quaternion and atan2 (row C5, table M6): as accurate
/// near 0 and π as anywhere.
///
/// @return  radians, |result| ≤ π; exactly at π one of the two signs
/// Adjoint: so3_log_adjoint, of the pivot's formula as a function of all nine entries. The result jumps at π.
template <class S>
Vector3<S> so3_log(const Matrix3<S>& rotation) {
  const Vector4<S> q = detail::pivot_quaternion(rotation).q;
  return detail::scaled_quaternion_log(Vector4<S>(q * S(detail::hemisphere(q))));
}

template <class S>
void so3_log_adjoint(const Matrix3<S>& rotation, const Vector3<S>& d_axis_angle, Matrix3<S>& d_rotation) {
  const auto pivot = detail::pivot_quaternion(rotation);
  const S sign(detail::hemisphere(pivot.q));
  Vector4<S> d_q = Vector4<S>::Zero();
  detail::scaled_quaternion_log_adjoint(Vector4<S>(pivot.q * sign), d_axis_angle, d_q);
  detail::pivot_quaternion_adjoint(pivot.pivot, Vector4<S>(d_q * sign), d_rotation);
}

/// Left Jacobian J of exp, I + c2 K + c3 K²: exp(w + d) = exp(J d) exp(w) to first order; V of SE(3). [Barfoot 2017,
/// eq. 7.85]
///
/// Adjoint: so3_left_jacobian_adjoint.
template <class S>
Matrix3<S> so3_left_jacobian(const Vector3<S>& axis_angle) {
  using W = detail::Wide<S>;
  const Vector3<W> w = axis_angle.template cast<W>();
  const Stumpff<W> c = stumpff(dot(w, w));
  return detail::identity_plus<S>(w, c.c2, c.c3);
}

template <class S>
void so3_left_jacobian_adjoint(const Vector3<S>& axis_angle, const Matrix3<S>& d_jacobian, Vector3<S>& d_axis_angle) {
  using W = detail::Wide<S>;
  const Vector3<W> w = axis_angle.template cast<W>();
  const Stumpff<W> c = stumpff(dot(w, w));
  detail::hat_polynomial_adjoint<S>(w, {c.c2, c.c3, c.d_c2(), c.d_c3()}, d_jacobian, d_axis_angle);
}

/// Right Jacobian of exp, the transposed left one: exp(w + d) = exp(w) exp(J d) to first order. Adjoint:
/// so3_right_jacobian_adjoint.
template <class S>
Matrix3<S> so3_right_jacobian(const Vector3<S>& axis_angle) {
  return so3_left_jacobian(axis_angle).transpose();
}

template <class S>
void so3_right_jacobian_adjoint(const Vector3<S>& axis_angle, const Matrix3<S>& d_jacobian, Vector3<S>& d_axis_angle) {
  so3_left_jacobian_adjoint(axis_angle, Matrix3<S>(d_jacobian.transpose()), d_axis_angle);
}

/// Inverse of the left Jacobian, I − K/2 + D K² (row C6: finite and accurate from 0 through π).
///
/// @param axis_angle  radians; the inverse does not exist where |w| is a positive multiple of 2π: wrap_axis_angle first
/// Adjoint: so3_left_jacobian_inverse_adjoint.
template <class S>
Matrix3<S> so3_left_jacobian_inverse(const Vector3<S>& axis_angle) {
  using W = detail::Wide<S>;
  const Vector3<W> w = axis_angle.template cast<W>();
  W value, derivative;
  detail::inverse_jacobian_coefficient(dot(w, w), value, derivative);
  return detail::identity_plus<S>(w, W(-0.5), value);
}

template <class S>
void so3_left_jacobian_inverse_adjoint(const Vector3<S>& axis_angle, const Matrix3<S>& d_inverse,
                                       Vector3<S>& d_axis_angle) {
  using W = detail::Wide<S>;
  const Vector3<W> w = axis_angle.template cast<W>();
  W value, derivative;
  detail::inverse_jacobian_coefficient(dot(w, w), value, derivative);
  detail::hat_polynomial_adjoint<S>(w, {W(-0.5), value, W(0), derivative}, d_inverse, d_axis_angle);
}

/// Inverse of the right Jacobian, the transposed inverse of the left one. Adjoint: so3_right_jacobian_inverse_adjoint.
template <class S>
Matrix3<S> so3_right_jacobian_inverse(const Vector3<S>& axis_angle) {
  return so3_left_jacobian_inverse(axis_angle).transpose();
}

template <class S>
void so3_right_jacobian_inverse_adjoint(const Vector3<S>& axis_angle, const Matrix3<S>& d_inverse,
                                        Vector3<S>& d_axis_angle) {
  so3_left_jacobian_inverse_adjoint(axis_angle, Matrix3<S>(d_inverse.transpose()), d_axis_angle);
}

/// The axis-angle vector of the same rotation with |w| ≤ π, w (1 − 2πn/|w|) (row D9: angles beyond π).
///
/// @param axis_angle  radians, float or double; left alone if |w| ≤ π (to rounding, so that wrapping twice changes
/// nothing) or
///                    not finite
/// @return            whether it was changed: an optimiser then clears the moments of these three numbers, which belong
/// to the old chart Adjoint: none, a change of parameters between steps.
template <class S>
bool wrap_axis_angle(Vector3<S>& axis_angle) {
  const Vector3<double> w = axis_angle.template cast<double>();
  const double angle = w.stableNorm();
  constexpr double kSlack = 1 + 2.0 * std::numeric_limits<S>::epsilon();
  if (!(angle > kSlack * std::numbers::pi) || !std::isfinite(angle)) return false;
  axis_angle = Vector3<double>(w * (std::remainder(angle, 2 * std::numbers::pi) / angle)).template cast<S>();
  return true;
}

}  // namespace hsi4d
