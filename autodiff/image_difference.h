// How far two images are apart, summed square by square, so that only what changed is summed again. Used by
// difference.h; not part of the public interface.
#pragma once

#include <algorithm>

#include "autodiff/tape.h"

namespace hsi4d::detail {

/// Whether image_difference can take them: images of one size, large enough to have squares, the weight of one plane or
/// all.
template <class S>
bool are_images(Var<S> a, Var<S> b, Var<S> weight) {
  const Shape& image = a.shape();
  if (image.rows < kMaskSquare || image.cols < kMaskSquare || !image.same_size(b.shape())) return false;
  if (weight.tape == nullptr) return true;
  const Shape& w = weight.shape();
  return w.rows == image.rows && w.cols == image.cols && (w.planes == 1 || w.planes == image.planes);
}

/// |d|; its derivative is 0 at 0. Its curvature is that of the parabola that touches it at d and −d, the weight of
/// iteratively reweighted least squares, 1/|d|, at most 1/least.
struct AbsoluteDifference {
  template <class S>
  static S value(S d) {
    return d < S(0) ? -d : d;
  }
  template <class S>
  static S derivative(S d) {
    return d > S(0) ? S(1) : d < S(0) ? S(-1) : d;  // 0, or not a number
  }
  template <class S>
  static S curvature(S d, S least) {
    return S(1) / std::max(value(d), least);
  }
};

/// d²
struct SquaredDifference {
  template <class S>
  static S value(S d) {
    return d * d;
  }
  template <class S>
  static S derivative(S d) {
    return d + d;
  }
  template <class S>
  static S curvature(S, S) {
    return S(2);
  }
};

/// Whether a term counts that has weight w: what has weight 0 is not looked at, so it may be infinite or no number.
template <class S>
bool counts(S w, S term) {
  return (w != S(0)) | (term - term == S(0));  // no branch: loops over it are vector code
}

/// Σ w f(a − b) over all numbers that count, in double, in an order that does not depend on what changed.
///
/// @param a, b    [C,H,W]
/// @param weight  [1,H,W], [C,H,W] or none
/// Adjoint: all inputs.
template <class S, class F>
Var<S> image_difference(Var<S> a, Var<S> b, Var<S> weight, Source where);

}  // namespace hsi4d::detail
