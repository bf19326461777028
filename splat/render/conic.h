// The ellipse of a projected Gaussian, in double. Used by composite.h; not part of the public interface.
#pragma once

#include <array>
#include <type_traits>

#include "core/lanes.h"

namespace hsi4d::detail {

/// The inverse of cov = V Vᵀ + blur I in lower-triangular form, in double,
///
///   dᵀ cov⁻¹ d = u² + w²,   u = l11 dx + l21 dy,   w = l22 dy,
///
/// from det(V Vᵀ + b I) = m01² + m02² + m12² + b tr(V Vᵀ) + b², m_ij the 2×2 minors of V: all terms are ≥ 0 (row A1).
/// T: double, or Lanes of them.
template <class T>
struct ConicOf {
  T l11{}, l21{}, l22{};
  T xx{}, xy{}, yy{};     ///< cov, pixels²
  T sharp_determinant{};  ///< det V Vᵀ
  T determinant{};        ///< det cov
};
using Conic = ConicOf<double>;

/// a d − b c without cancellation: the product b c is corrected by its rounding error (Kahan).
template <class T>
T difference_of_products(const T& a, const T& d, const T& b, const T& c) {
  const T bc = b * c;
  return lane_fma(a, d, T(-bc)) + lane_fma(T(-b), c, bc);
}

/// Minors m01, m02, m12 of a 2×3 matrix.
template <class T>
std::array<T, 3> minors(const T* v) {
  return {difference_of_products(v[0], v[4], v[1], v[3]), difference_of_products(v[0], v[5], v[2], v[3]),
          difference_of_products(v[1], v[5], v[2], v[4])};
}

/// False where cov has no inverse (blur 0 and no area) or a number is not finite.
///
/// @param factor  [2,3] V by rows, pixels
/// @param blur    pixels²
template <class T>
LaneMask<T> conic_of(const T* v, double blur, ConicOf<T>& conic) {
  const T a = v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
  const T c = v[3] * v[3] + v[4] * v[4] + v[5] * v[5];
  const auto m = minors(v);
  conic.xx = a + blur;
  conic.yy = c + blur;
  conic.xy = v[0] * v[3] + v[1] * v[4] + v[2] * v[5];
  conic.sharp_determinant = m[0] * m[0] + m[1] * m[1] + m[2] * m[2];
  conic.determinant = conic.sharp_determinant + blur * (a + c) + blur * blur;
  const T root_yy = lane_sqrt(conic.yy);
  conic.l11 = root_yy / lane_sqrt(conic.determinant);
  conic.l21 = -conic.xy / conic.yy * conic.l11;
  conic.l22 = 1.0 / root_yy;
  return (conic.determinant > 0.0) & lane_finite(conic.determinant) & lane_finite(conic.l11) & lane_finite(conic.l21) &
         lane_finite(conic.l22);
}

/// L V with L = [l11 l21; 0 l22], 2×3 by rows. Its first row, l11 (v0 − xy/yy v1), cancels for needles; by the minors,
/// which it is made of here, (v0 − xy/yy v1)_c = (Σ_k v1_k m_ck + b v0_c)/yy, it does not.
template <class T>
std::array<T, 6> whitened_factor(const T* v, double blur, const T& l11, const T& l22) {
  const auto m = minors(v);
  const T scale = l11 * (l22 * l22);  // l11/yy
  return {scale * (v[4] * m[0] + v[5] * m[1] + blur * v[0]),
          scale * (v[5] * m[2] - v[3] * m[0] + blur * v[1]),
          scale * (-v[3] * m[1] - v[4] * m[2] + blur * v[2]),
          l22 * v[3],
          l22 * v[4],
          l22 * v[5]};
}

/// sqrt(det V Vᵀ / det cov): what the opacity is multiplied with under antialias (row A7: antialias).
template <class T>
T blur_compensation(const ConicOf<T>& conic) {
  return lane_sqrt(T(conic.sharp_determinant / conic.determinant));
}

/// d_V += d · ∂compensation/∂V; nothing where det V Vᵀ = 0.
// log f = ½ (log det V Vᵀ − log det cov), and both determinants are polynomials in V.
template <class T>
void blur_compensation_adjoint(const T* v, double blur, const ConicOf<T>& conic, const std::type_identity_t<T>& d,
                               T* d_v) {
  const LaneMask<T> some = conic.sharp_determinant > 0.0;
  const auto m = minors(v);
  // ½ ∂(det V Vᵀ)/∂V = Σ m ∂m/∂V
  const T half_sharp[6] = {m[0] * v[4] + m[1] * v[5],  m[2] * v[5] - m[0] * v[3], -m[1] * v[3] - m[2] * v[4],
                           -m[0] * v[1] - m[1] * v[2], m[0] * v[0] - m[2] * v[2], m[1] * v[0] + m[2] * v[1]};
  const T scale = d * blur_compensation(conic), zero{};
  for (int i = 0; i < 6; ++i) {
    const T d_i = scale * (half_sharp[i] / conic.sharp_determinant - (half_sharp[i] + blur * v[i]) / conic.determinant);
    d_v[i] = d_v[i] + (some ? d_i : zero);
  }
}

}  // namespace hsi4d::detail
