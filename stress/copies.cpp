// Rows F13 and F14: what several Gaussians at one place have in place of one.
#include <algorithm>
#include <cmath>
#include <vector>

#include "splat/density.h"
#include "stress/rows.h"

namespace hsi4d::stress {

namespace {

constexpr long double kOpacities[] = {1e-7L, 1e-4L, 0.005L, 0.1L, 0.5L, 0.9L, 0.9999L, 0.999999L};

double relative(double measured, long double exact) {
  return static_cast<double>(std::fabs((static_cast<long double>(measured) - exact) / exact));
}

long double exact_opacity(long double opacity, Index copies) {
  return -std::expm1(std::log1p(-opacity) / static_cast<long double>(copies));
}

/// Σ_{i=1}^{N} Σ_{k=0}^{i−1} C(i−1, k) (−1)ᵏ o'ᵏ⁺¹/√(k+1), as it is written in the paper.
template <class T>
T sum_as_written(T shared, Index copies) {
  T sum = 0;
  for (Index i = 1; i <= copies; ++i) {
    T binomial = 1, power = 1;
    for (Index k = 0; k < i; ++k) {
      power *= shared;
      sum += (k % 2 == 0 ? 1 : -1) * binomial * power / std::sqrt(static_cast<T>(k + 1));
      binomial *= static_cast<T>(i - 1 - k) / static_cast<T>(k + 1);
    }
  }
  return sum;
}

/// The largest of what `error` tells of an opacity and a number of copies.
template <class F>
double worst(const F& error) {
  double largest = 0;
  for (const long double opacity : kOpacities) {
    for (const Index copies : {2, 3, 7, 20, 51}) largest = std::max(largest, error(opacity, copies));
  }
  return largest;
}

}  // namespace

std::vector<StressFigure> opacities_of_copies(Remedy remedy) {
  const auto opacity_of = [remedy](long double opacity, Index copies) {
    if (remedy == Remedy::kOn) return shared_shape(static_cast<double>(opacity), copies).opacity;
    const auto o = static_cast<float>(opacity);
    return static_cast<double>(1 - std::pow(1 - o, 1 / static_cast<float>(copies)));
  };
  return {{"relative error of an opacity", worst([&](long double opacity, Index copies) {
             return relative(opacity_of(opacity, copies), exact_opacity(opacity, copies));
           }),
           1e-6}};
}

std::vector<StressFigure> scales_of_copies(Remedy remedy) {
  const auto scale_of = [remedy](long double opacity, Index copies) {
    if (remedy == Remedy::kOn) return shared_shape(static_cast<double>(opacity), copies).scale;
    const auto shared = static_cast<float>(exact_opacity(opacity, copies));
    return static_cast<double>(static_cast<float>(opacity) / sum_as_written(shared, copies));
  };
  return {{"relative error of a scale", worst([&](long double opacity, Index copies) {
             return relative(scale_of(opacity, copies),
                             opacity / sum_as_written(exact_opacity(opacity, copies), copies));
           }),
           1e-6}};
}

}  // namespace hsi4d::stress
