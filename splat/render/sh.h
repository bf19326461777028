// Colours of Gaussians by direction: real spherical harmonics, with the basis and signs of INRIA's 3DGS files.
//
//   colour = max(0, ½ + Σ_k Y_k(r) sh_k),   r = (m − c)/|m − c|, world axes, from the camera to the Gaussian
#pragma once

#include "splat/sh_basis.h"
#include "splat/view.h"

namespace hsi4d {

/// Colours as the camera Exp(ξ) · view.camera sees them.
///
/// The degree is the smaller of view.settings.sh_degree and that of `sh`; coefficients above it are not touched, and at
/// degree 0 neither are means, ξ and transform. Where the mean is the camera's centre r = (0, 0, 1) (row B19).
///
/// @param sh         [N,3K], number 3k + c is coefficient k of channel c; K = 1, 4, 9 or 16
/// @param means      [N,3] metres, relative to view.origin_world
/// @param xi         [1,6] see splat/view.h
/// @param transform  empty, or [1,12], rows [3,4]: how a rigid object was moved. Directions are taken back into its own
///                   axes, r ← Aᵀ r with A the linear part
/// @return           [N,3] ≥ 0; NaN where a number that it depends on is not finite, and then not drawn
/// Adjoint: sh, means, xi, transform (as an unconstrained matrix). None where the sum is ≤ 0 or a Gaussian's colour is
/// NaN, nor for the direction where the mean is the camera's centre. Throws InternalError when the shapes do not fit.
template <class S>
Var<S> sh_colors(Var<S> sh, Var<S> means, Var<S> xi, const SplatView& view, Var<S> transform = {},
                 Source where = Source::current());

}  // namespace hsi4d
