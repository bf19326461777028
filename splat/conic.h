// The ellipse of a projected Gaussian, in double. Used by composite.h; not part of the public interface.
#pragma once

#include <array>
#include <cmath>

namespace hsi4d::detail {

/// The inverse of cov = V Vᵀ + blur I in lower-triangular form, in double,
///
///   dᵀ cov⁻¹ d = u² + w²,   u = l11 dx + l21 dy,   w = l22 dy,
///
/// from det(V Vᵀ + b I) = m01² + m02² + m12² + b tr(V Vᵀ) + b², m_ij the 2×2 minors of V: all terms are ≥ 0 (row A1).
struct Conic {
  double l11 = 0, l21 = 0, l22 = 0;
  double xx = 0, xy = 0, yy = 0;  ///< cov, pixels²
  double sharp_determinant = 0;   ///< det V Vᵀ
  double determinant = 0;         ///< det cov
};

/// a d − b c without cancellation: the product b c is corrected by its rounding error (Kahan).
inline double difference_of_products(double a, double d, double b, double c) {
  const double bc = b * c;
  return std::fma(a, d, -bc) + std::fma(-b, c, bc);
}

/// Minors m01, m02, m12 of a 2×3 matrix.
inline std::array<double, 3> minors(const double* v) {
  return {difference_of_products(v[0], v[4], v[1], v[3]), difference_of_products(v[0], v[5], v[2], v[3]),
          difference_of_products(v[1], v[5], v[2], v[4])};
}

/// False where cov has no inverse (blur 0 and no area) or a number is not finite.
///
/// @param factor  [2,3] V by rows, pixels
/// @param blur    pixels²
inline bool conic_of(const double* v, double blur, Conic& conic) {
  const double a = v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
  const double c = v[3] * v[3] + v[4] * v[4] + v[5] * v[5];
  const auto m = minors(v);
  conic.xx = a + blur;
  conic.yy = c + blur;
  conic.xy = v[0] * v[3] + v[1] * v[4] + v[2] * v[5];
  conic.sharp_determinant = m[0] * m[0] + m[1] * m[1] + m[2] * m[2];
  conic.determinant = conic.sharp_determinant + blur * (a + c) + blur * blur;
  if (!(conic.determinant > 0) || !std::isfinite(conic.determinant)) return false;
  const double root_yy = std::sqrt(conic.yy);
  conic.l11 = root_yy / std::sqrt(conic.determinant);
  conic.l21 = -conic.xy / conic.yy * conic.l11;
  conic.l22 = 1 / root_yy;
  return std::isfinite(conic.l11) && std::isfinite(conic.l21) && std::isfinite(conic.l22);
}

/// L V with L = [l11 l21; 0 l22], 2×3 by rows. Its first row, l11 (v0 − xy/yy v1), cancels for needles; by the minors,
/// which it is made of here, (v0 − xy/yy v1)_c = (Σ_k v1_k m_ck + b v0_c)/yy, it does not.
inline std::array<double, 6> whitened_factor(const double* v, double blur, double l11, double l22) {
  const auto m = minors(v);
  const double scale = l11 * (l22 * l22);  // l11/yy
  return {scale * (v[4] * m[0] + v[5] * m[1] + blur * v[0]),
          scale * (v[5] * m[2] - v[3] * m[0] + blur * v[1]),
          scale * (-v[3] * m[1] - v[4] * m[2] + blur * v[2]),
          l22 * v[3],
          l22 * v[4],
          l22 * v[5]};
}

/// sqrt(det V Vᵀ / det cov): what the opacity is multiplied with under antialias (row A7).
inline double blur_compensation(const Conic& conic) { return std::sqrt(conic.sharp_determinant / conic.determinant); }

/// d_V += d · ∂compensation/∂V; nothing where det V Vᵀ = 0.
// log f = ½ (log det V Vᵀ − log det cov), and both determinants are polynomials in V.
inline void blur_compensation_adjoint(const double* v, double blur, const Conic& conic, double d, double* d_v) {
  if (!(conic.sharp_determinant > 0)) return;
  const auto m = minors(v);
  // ½ ∂(det V Vᵀ)/∂V = Σ m ∂m/∂V
  const double half_sharp[6] = {m[0] * v[4] + m[1] * v[5],  m[2] * v[5] - m[0] * v[3], -m[1] * v[3] - m[2] * v[4],
                                -m[0] * v[1] - m[1] * v[2], m[0] * v[0] - m[2] * v[2], m[1] * v[0] + m[2] * v[1]};
  const double scale = d * blur_compensation(conic);
  for (int i = 0; i < 6; ++i) {
    d_v[i] += scale * (half_sharp[i] / conic.sharp_determinant - (half_sharp[i] + blur * v[i]) / conic.determinant);
  }
}

}  // namespace hsi4d::detail
