// Projection of Gaussians to the image.
//
//   p = W (m − c)            the difference in double, c the camera's centre relative to the view's origin  (row A10)
//   u = fx x/z + cx,  v = fy y/z + cy
//   V = J W M,  J = [fx/z  0  −fx h_x/z;  0  fy/z  −fy h_y/z]                        [Zwicker et al. 2002, eq. 31]
//
// with M the Gaussian's axes and h_x = x/z held in [−cx/fx − m, (W−cx)/fx + m], m = (frustum_clamp − 1) W/(2 fx), h_y
// likewise with fy, cy, H (rows A2, A3). The mean itself is not held. Everything is computed in double and rounded
// once. fx, fy, cx, cy are the camera's, or four numbers on the tape.
#pragma once

#include "splat/view.h"

namespace hsi4d {

/// Gaussians in the image. A row of `factors` that is six zeros marks a Gaussian that is not to be drawn.
template <class S>
struct Projected {
  Var<S> means_px;   ///< [N,2] (u, v); the centre of row i, column j is (j + 0.5, i + 0.5)
  Var<S> factors;    ///< [N,6] V, 2×3 by rows, pixels
  Var<S> depths;     ///< [N,1] camera z, metres, drawn or not; 0 where the point is not finite
  Var<S> depth_low;  ///< [N,1] what rounding took from the depths in float, zeros in double; has no adjoint
  Var<S> means_low;  ///< [N,2] what rounding took from the means, likewise
};

/// Projects Gaussians with the camera Exp(ξ) · view.camera.
///
/// Gaussians at z ≤ near, and those with numbers that are not finite (of the input or the result), get means_px = 0 and
/// factors = 0, and no gradient through these. Their depth is that of any other, with its gradient to mean and ξ, as
/// long as the point in the camera's frame is finite.
///
/// @param means  [N,3] metres, relative to view.origin_world
/// @param axes   [N,9] metres, 3×3 by rows, world (see gaussian_axes)
/// @param xi     [1,6] (translation, rotation), metres and radians, in the camera's frame
/// @param intrinsics  [1,4] fx, fy, cx, cy in pixels, instead of the view's; none: the view's, at no cost
/// Adjoint: means, axes, xi (exact for any ξ), intrinsics (exact: means, the Jacobian, and the limits at which x/z and
/// y/z are held, which move with them). None through a held x/z or y/z to mean and ξ (z still moves h/z).
/// Throws InternalError when the shapes do not fit, UserError for a camera that makes no sense, which intrinsics are
/// looked at for in every run.
template <class S>
Projected<S> project(Var<S> means, Var<S> axes, Var<S> xi, const SplatView& view, Var<S> intrinsics = {},
                     Source where = Source::current());

}  // namespace hsi4d
