// An image times weights, for losses that look at neighbourhoods of pixels.
#pragma once

#include "autodiff/tape.h"

namespace hsi4d {

/// a · w, 0 where w is, whatever `a` is there. As a product of elements, but where the weights are given and have no
/// gradient, nobody has to make `a` in squares of pixels in which all of them are 0 (skip.unread_pixels), and what did
/// not change of `a` is not multiplied again.
///
/// @param a  [C,H,W]
/// @param w  [1,H,W]
/// Adjoint: a, w. Throws InternalError when the shapes do not fit.
template <class S>
Var<S> weighted_image(Var<S> a, Var<S> w, Source where = Source::current());

extern template Var<float> weighted_image(Var<float>, Var<float>, Source);
extern template Var<double> weighted_image(Var<double>, Var<double>, Source);

}  // namespace hsi4d
