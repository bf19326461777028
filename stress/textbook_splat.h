// A Gaussian in the image by the formulas of most renderers: in float what rows about its ellipse are measured against
// with their remedies taken away, in more digits what they are measured with.
#pragma once

#include <array>

namespace hsi4d::stress {

/// cov = V Vᵀ + blur I by its entries, and what follows from them.
template <class S>
struct TextbookSplat {
  S xx, xy, yy;   ///< pixels²
  S determinant;  ///< xx yy − xy²
  S a, b, c;      ///< of the inverse [a b; b c]

  /// ½ dᵀ cov⁻¹ d
  S exponent(S dx, S dy) const { return S(0.5) * (a * dx * dx + c * dy * dy) + b * dx * dy; }
};

/// @param v  [2,3] by rows, pixels
template <class S>
TextbookSplat<S> textbook_splat(const std::array<S, 6>& v, S blur) {
  TextbookSplat<S> s{};
  s.xx = v[0] * v[0] + v[1] * v[1] + v[2] * v[2] + blur;
  s.xy = v[0] * v[3] + v[1] * v[4] + v[2] * v[5];
  s.yy = v[3] * v[3] + v[4] * v[4] + v[5] * v[5] + blur;
  s.determinant = s.xx * s.yy - s.xy * s.xy;
  s.a = s.yy / s.determinant;
  s.b = -s.xy / s.determinant;
  s.c = s.xx / s.determinant;
  return s;
}

}  // namespace hsi4d::stress
