// What a render looks with: a camera that may be moved by six numbers, where the Gaussians' origin lies, and settings.
//
// The camera of a run is Exp(ξ) · camera_from_world, ξ = (translation, rotation) [1,6], computed in double inside every
// operator that needs it. With a change δ of that camera from the left, Exp(δ) Exp(ξ) T,
//
//   p' = p + δ_ρ + δ_φ × p        u' = u + δ_φ × u        c' = c − W⁻¹ δ_ρ
//
// for a point p, a direction u and the camera's centre c; operators sum d_δ, and d_ξ follows once (exact for any ξ).
#pragma once

#include "autodiff/tape.h"
#include "core/camera.h"
#include "splat/render_settings.h"

namespace hsi4d {

/// Plain data. Means are relative to origin_world, metres (row A10: far from the origin).
struct SplatView {
  Camera camera;
  Vector3<double> origin_world = Vector3<double>::Zero();
  RenderSettings settings;
  RenderSkips skip = {};
};

namespace detail {

/// The camera of one run of an operator.
struct MovedCamera {
  Matrix3<double> rotation;  ///< W, camera from world; used as given, also where it is orthonormal only to 1e-4
  Matrix3<double> inverse;   ///< W⁻¹
  Vector3<double> center;    ///< relative to the view's origin, metres
};

/// The camera Exp(ξ) T. Far from the origin nothing is lost: ξ moves the centre, not the translation of T.
MovedCamera moved_camera(const SplatView& view, const Vector6<double>& xi);

/// d_ξ += of d_δ, the gradient of a change of the moved camera from the left; at ξ = 0 the two are equal.
void moved_camera_adjoint(const Vector6<double>& xi, const Vector6<double>& d_delta, Vector6<double>& d_xi);

/// The six numbers of an input.
template <class S>
Vector6<double> camera_update(const ConstArray<S>& xi) {
  Vector6<double> result;
  for (int i = 0; i < 6; ++i) result[i] = static_cast<double>(xi.data[i]);
  return result;
}

/// Adds d_ξ made from the partial sums of d_δ, 6 numbers a chunk, pairwise in the chunks' order.
template <class S>
void add_camera_gradient(const ConstArray<S>& xi, std::span<const double> partials, Index chunks, const Array<S>& d_xi);

}  // namespace detail
}  // namespace hsi4d
