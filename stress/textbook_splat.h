// A Gaussian in the image by the formulas of most renderers, in float: what rows about its ellipse are measured against
// with their remedies taken away.
#pragma once

#include <array>

namespace hsi4d::stress {

/// cov = V Vᵀ + blur I by its entries, and what follows from them.
struct TextbookSplat {
  float xx, xy, yy;   ///< pixels²
  float determinant;  ///< xx yy − xy²
  float a, b, c;      ///< of the inverse [a b; b c]

  /// ½ dᵀ cov⁻¹ d
  float exponent(float dx, float dy) const { return 0.5F * (a * dx * dx + c * dy * dy) + b * dx * dy; }
};

/// @param factor  [2,3] V by rows, pixels
inline TextbookSplat textbook_splat(const std::array<float, 6>& v, float blur) {
  TextbookSplat s{};
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
