// Seams between what is optimised and the loss: where a gradient can be replaced by how it changes, so that the tape
// multiplies by a Gauss–Newton matrix.
//
// With y(x) the model, φ(y) the loss and seams at y, an ordinary run gives g = Jᵀ ∇φ(y), J = ∂y/∂x, and each seam keeps
// ∇φ(y). A run at x + h p in which the seams tell of the change gives
//
//   Jᵀ [∇φ(y(x + h p)) − ∇φ(y(x))] / h  →  Jᵀ ∇²φ(y) J p        as h → 0
//
// the product of p with the generalised Gauss–Newton matrix [Schraudolph 2002, Fast curvature matrix-vector products
// for second-order gradient descent]: JᵀWJ of a weighted sum of squares, and no second derivative of the model in it. J
// is that at x + h p, which changes the product by as little as the difference does. It costs a forward and a backward
// run.
#pragma once

#include "autodiff/tape.h"

namespace hsi4d {

/// What the adjoints of seams are; to be set before a forward run.
struct SeamMode {
  /// The gradient minus what it was in the last backward run in which this was false, times `scale`.
  bool of_change = false;
  double scale = 1;  ///< 1/h
};

/// x itself.
///
/// @param mode  read in every backward run; has to outlive the recording
/// Adjoint: x, as `mode` says. Where x is an image that tells which squares of it are read (NodeIo::read), a change is
/// 0 in squares that were not read when the gradient was kept: nothing that moves was seen there.
template <class S>
Var<S> seam(Var<S> x, const SeamMode& mode, Source where = Source::current());

/// Mean of ρ(a − b), ρ(d) = |d| − ε/2 beyond ε, d²/(2 ε) within it: |d| as a sum of squares with weights
/// w = 1/max(|d|, ε), which is how its curvature is counted.
///
/// In the runs of `mode` that tell of a change the weights stay what they were, so that a seam's product has JᵀWJ for
/// this mean: iteratively reweighted least squares [Huber 1964; Holland and Welsch 1977]. The curvature of |d| itself
/// is 0 almost everywhere.
///
/// @param a, b  [C,H,W] or any one shape
/// Adjoint: a. None for b. Throws InternalError for different shapes, or floor ≤ 0.
template <class S>
Var<S> reweighted_l1(Var<S> a, Var<S> b, double floor, const SeamMode& mode, Source where = Source::current());

extern template Var<float> seam(Var<float>, const SeamMode&, Source);
extern template Var<double> seam(Var<double>, const SeamMode&, Source);
extern template Var<float> reweighted_l1(Var<float>, Var<float>, double, const SeamMode&, Source);
extern template Var<double> reweighted_l1(Var<double>, Var<double>, double, const SeamMode&, Source);

}  // namespace hsi4d
