#include "splat/density.h"

#include <algorithm>
#include <cmath>

#include "core/check.h"

namespace hsi4d {

SharedShape shared_shape(double opacity, Index copies) {
  HSI4D_CHECK(opacity >= 0 && opacity <= 1, "an opacity");
  HSI4D_CHECK(copies >= 1 && copies <= kMostCopies, "a number of copies");
  if (copies == 1 || opacity == 0) return {opacity, 1};
  const double o = std::min(opacity, kMostSharedOpacity);
  const double shared = -std::expm1(std::log1p(-o) / static_cast<double>(copies));
  // Σ_{i=1}^{N} C(i−1, k) = C(N, k+1): one sum in place of two.
  double sum = 0, binomial = 1, power = 1;
  for (Index k = 0; k < copies; ++k) {
    binomial *= static_cast<double>(copies - k) / static_cast<double>(k + 1);
    power *= shared;
    sum += (k % 2 == 0 ? 1 : -1) * binomial * power / std::sqrt(static_cast<double>(k + 1));
  }
  return {shared, o / sum};
}

}  // namespace hsi4d
