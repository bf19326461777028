// Rigid transforms, SE(3): T p = R p + t.
//
// A tangent vector is ξ = (translation ρ, rotation φ), in this order, metres and radians. With J the left Jacobian of
// SO(3) (rotation.h),
//
//   Exp(ξ) = (exp(φ), J(φ) ρ),   Log(R, t) = (J⁻¹(φ) t, φ),  φ = log R          [Barfoot 2017, section 7.1]
//
// and an update is T ← Exp(ξ) T: for world-to-camera T, ξ lives in the camera's frame.
#pragma once

#include "core/rotation.h"

namespace hsi4d {

/// A rigid transform; also the shape of its gradient (start that from zero()).
template <class S>
struct Rigid {
  Matrix3<S> rotation = Matrix3<S>::Identity();
  Vector3<S> translation = Vector3<S>::Zero();  ///< metres

  static Rigid zero() { return {Matrix3<S>::Zero(), Vector3<S>::Zero()}; }
};

/// R p + t. Adjoint: transform_point_adjoint, both arguments.
///
/// Far from the origin (row A10) use point_in_view of camera.h, which subtracts before it rotates.
template <class S>
Vector3<S> transform_point(const Rigid<S>& transform, const Vector3<S>& point) {
  return transform.rotation * point + transform.translation;
}

/// d_R += g pᵀ, d_t += g, d_p += Rᵀ g.
template <class S>
void transform_point_adjoint(const Rigid<S>& transform, const Vector3<S>& point, const Vector3<S>& d_transformed,
                             Rigid<S>& d_transform, Vector3<S>& d_point) {
  d_transform.rotation += d_transformed * point.transpose();
  d_transform.translation += d_transformed;
  d_point += transform.rotation.transpose() * d_transformed;
}

/// outer inner: inner is applied first. Adjoint: compose_adjoint, both arguments.
template <class S>
Rigid<S> compose(const Rigid<S>& outer, const Rigid<S>& inner) {
  return {outer.rotation * inner.rotation, transform_point(outer, inner.translation)};
}

template <class S>
void compose_adjoint(const Rigid<S>& outer, const Rigid<S>& inner, const Rigid<S>& d_composed, Rigid<S>& d_outer,
                     Rigid<S>& d_inner) {
  d_outer.rotation += d_composed.rotation * inner.rotation.transpose();
  d_inner.rotation += outer.rotation.transpose() * d_composed.rotation;
  transform_point_adjoint(outer, inner.translation, d_composed.translation, d_outer, d_inner.translation);
}

/// (Rᵀ, −Rᵀ t). Adjoint: inverse_adjoint.
template <class S>
Rigid<S> inverse(const Rigid<S>& transform) {
  return {transform.rotation.transpose(), -(transform.rotation.transpose() * transform.translation)};
}

/// d_R += G_Rᵀ − t g_tᵀ, d_t −= R g_t.
template <class S>
void inverse_adjoint(const Rigid<S>& transform, const Rigid<S>& d_inverse, Rigid<S>& d_transform) {
  d_transform.rotation += d_inverse.rotation.transpose() - transform.translation * d_inverse.translation.transpose();
  d_transform.translation -= transform.rotation * d_inverse.translation;
}

/// Exp(ξ) = (exp(φ), J(φ) ρ). Adjoint: se3_exp_adjoint.
///
/// @param xi  (translation, rotation): metres, radians; smooth at 0
template <class S>
Rigid<S> se3_exp(const Vector6<S>& xi) {
  const Vector3<S> rho = xi.template head<3>();
  const Vector3<S> phi = xi.template tail<3>();
  return {so3_exp(phi), so3_left_jacobian(phi) * rho};
}

template <class S>
void se3_exp_adjoint(const Vector6<S>& xi, const Rigid<S>& d_transform, Vector6<S>& d_xi) {
  const Vector3<S> rho = xi.template head<3>();
  const Vector3<S> phi = xi.template tail<3>();
  Vector3<S> d_phi = Vector3<S>::Zero();
  so3_exp_adjoint(phi, d_transform.rotation, d_phi);
  so3_left_jacobian_adjoint(phi, Matrix3<S>(d_transform.translation * rho.transpose()), d_phi);
  d_xi.template head<3>() += so3_left_jacobian(phi).transpose() * d_transform.translation;
  d_xi.template tail<3>() += d_phi;
}

/// Log(R, t) = (J⁻¹(φ) t, φ) with |φ| ≤ π. Adjoint: se3_log_adjoint; as so3_log, the result jumps at π.
template <class S>
Vector6<S> se3_log(const Rigid<S>& transform) {
  const Vector3<S> phi = so3_log(transform.rotation);
  Vector6<S> xi;
  xi.template head<3>() = so3_left_jacobian_inverse(phi) * transform.translation;
  xi.template tail<3>() = phi;
  return xi;
}

template <class S>
void se3_log_adjoint(const Rigid<S>& transform, const Vector6<S>& d_xi, Rigid<S>& d_transform) {
  const Vector3<S> phi = so3_log(transform.rotation);
  const Vector3<S> d_rho = d_xi.template head<3>();
  Vector3<S> d_phi = d_xi.template tail<3>();
  so3_left_jacobian_inverse_adjoint(phi, Matrix3<S>(d_rho * transform.translation.transpose()), d_phi);
  so3_log_adjoint(transform.rotation, d_phi, d_transform.rotation);
  d_transform.translation += so3_left_jacobian_inverse(phi).transpose() * d_rho;
}

/// The matrix Ad with T Exp(η) T⁻¹ = Exp(Ad η): [R, hat(t) R; 0, R] for ξ = (translation, rotation).
/// [Barfoot 2017, eq. 7.45]
template <class S>
Matrix6<S> se3_adjoint_matrix(const Rigid<S>& transform) {
  Matrix6<S> ad = Matrix6<S>::Zero();
  ad.template topLeftCorner<3, 3>() = transform.rotation;
  ad.template topRightCorner<3, 3>() = hat(transform.translation) * transform.rotation;
  ad.template bottomRightCorner<3, 3>() = transform.rotation;
  return ad;
}

/// Exp(ξ) T, an optimiser's step. Adjoint: compose_adjoint with se3_exp_adjoint; at ξ = 0 se3_update_adjoint_at_zero.
template <class S>
Rigid<S> se3_update(const Vector6<S>& xi, const Rigid<S>& transform) {
  return compose(se3_exp(xi), transform);
}

/// d_ξ of Exp(ξ) T at ξ = 0: (g_t, axial(G_R Rᵀ) + t × g_t).
template <class S>
void se3_update_adjoint_at_zero(const Rigid<S>& transform, const Rigid<S>& d_updated, Vector6<S>& d_xi) {
  d_xi.template head<3>() += d_updated.translation;
  d_xi.template tail<3>() += axial(Matrix3<S>(d_updated.rotation * transform.rotation.transpose())) +
                             cross(transform.translation, d_updated.translation);
}

/// Exp(ξ) p. Adjoint: se3_transform_point_adjoint, both arguments, any ξ.
template <class S>
Vector3<S> se3_transform_point(const Vector6<S>& xi, const Vector3<S>& point) {
  return transform_point(se3_exp(xi), point);
}

template <class S>
void se3_transform_point_adjoint(const Vector6<S>& xi, const Vector3<S>& point, const Vector3<S>& d_transformed,
                                 Vector6<S>& d_xi, Vector3<S>& d_point) {
  Rigid<S> d_transform = Rigid<S>::zero();
  transform_point_adjoint(se3_exp(xi), point, d_transformed, d_transform, d_point);
  se3_exp_adjoint(xi, d_transform, d_xi);
}

/// d_ξ of Exp(ξ) p at ξ = 0: (g, p × g). For an update of the camera p is the point in the camera's frame.
template <class S>
void se3_transform_point_adjoint_at_zero(const Vector3<S>& point, const Vector3<S>& d_transformed, Vector6<S>& d_xi) {
  d_xi.template head<3>() += d_transformed;
  d_xi.template tail<3>() += cross(point, d_transformed);
}

}  // namespace hsi4d
