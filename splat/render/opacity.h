// Opacities of Gaussians from the logits that files and optimisers hold.
#pragma once

#include "autodiff/tape.h"

namespace hsi4d {

/// o = 1/(1 + e⁻ˣ). The slope is right far into saturation (row B15); a logit that is NaN gives an opacity that is NaN,
/// with which composite draws nothing.
///
/// @param logits  [N,1], any shape
/// @return        of the same shape
/// Adjoint: logits, with o (1 − o); exactly 0 for one that is NaN.
template <class S>
Var<S> gaussian_opacities(Var<S> logits, Source where = Source::current());

}  // namespace hsi4d
