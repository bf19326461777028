// The axes of Gaussians: a 3×3 factor A R S of each covariance, which is never formed itself (row A1: needles).
#pragma once

#include "autodiff/tape.h"

namespace hsi4d {

/// Axes of Gaussians, M = R(q) diag(exp(l)).
///
/// The quaternion is raw and normalised here (row A13). A log-scale is held in [−kLogScaleLimit, kLogScaleLimit] (row
/// A5). A Gaussian whose quaternion is zero or not finite, or of which a log-scale is NaN, gets nine zeros: no Gaussian
/// has these, and `project` and `composite` take them as "draw nothing".
///
/// @param quats       [N,4] wxyz, any length
/// @param log_scales  [N,3] natural logarithm of metres
/// @return            [N,9] metres, rows of the 3×3 matrix whose columns are the axes times the scales
/// Adjoint: quats (orthogonal to q), log_scales (none where it is held). None for a Gaussian of nine zeros.
/// Throws InternalError when the shapes do not fit.
template <class S>
Var<S> gaussian_axes(Var<S> quats, Var<S> log_scales, Source where = Source::current());

/// Axes after a linear map, M' = A M. A need not be a rotation (a blend of skinning transforms is none; row D2).
///
/// @param transforms  [N,12] or [1,12], rows [3,4]; the last column has no part in it
/// @param axes        [N,9] metres
/// @return            [N,9] metres
/// Adjoint: transforms, axes; each computed only when wanted.
/// Throws InternalError when the shapes do not fit.
template <class S>
Var<S> transform_axes(Var<S> transforms, Var<S> axes, Source where = Source::current());

}  // namespace hsi4d
