// How far two arrays are apart: L1, L2, Huber and Charbonnier means.
//
// Each is a mean over the broadcast elements of `a` and `b`. With `weight` (broadcast, for example a mask [1,H,W] over
// an image [C,H,W]) each element's term is multiplied by it; the mean is still over all elements. What has weight 0 is
// not looked at: a term there that is infinite or no number counts as 0 and has no gradient.
#pragma once

#include "autodiff/tape.h"

namespace hsi4d {

/// Mean |a − b|. Gradient 0 where a = b (row E4: |x| at 0). Adjoint: a, b, weight.
template <class S>
Var<S> l1(Var<S> a, Var<S> b, Source where = Source::current());
template <class S>
Var<S> l1(Var<S> a, Var<S> b, Var<S> weight, Source where = Source::current());

/// Mean (a − b)². Adjoint: a, b, weight.
template <class S>
Var<S> l2(Var<S> a, Var<S> b, Source where = Source::current());
template <class S>
Var<S> l2(Var<S> a, Var<S> b, Var<S> weight, Source where = Source::current());

/// Mean of ½ d² for |d| ≤ delta, else delta (|d| − ½ delta), d = a − b. Adjoint: a, b. Throws InternalError for delta ≤
/// 0.
template <class S>
Var<S> huber(Var<S> a, Var<S> b, double delta, Source where = Source::current());

/// Mean of √(d² + epsilon²) − epsilon, d = a − b, computed without cancellation. Adjoint: a, b. Throws InternalError
/// for epsilon ≤ 0.
template <class S>
Var<S> charbonnier(Var<S> a, Var<S> b, double epsilon, Source where = Source::current());

}  // namespace hsi4d
