// Where the mass of images lies.
#pragma once

#include "autodiff/tape.h"

namespace hsi4d {

/// Centre and mass of each of O images.
///
///   M = Σ m(u),   x = Σ m(u) u_x / M,   y = Σ m(u) u_y / M,   u = (j + ½, i + ½) for row i, column j
///
/// Summed in double (row E5: long float sums).
///
/// @param masks  [O,H,W] mass of each pixel, ≥ 0
/// @return       [O,3] rows (x, y, M), pixels; x = y = 0 without gradient where M is 0
/// Adjoint: masks, d_m = (d_x (u_x − x) + d_y (u_y − y)) / M + d_M.
template <class S>
Var<S> centroids(Var<S> masks, Source where = Source::current());

extern template Var<float> centroids(Var<float>, Source);
extern template Var<double> centroids(Var<double>, Source);

}  // namespace hsi4d
