// Rows C: rotations.
#include <algorithm>
#include <array>
#include <cmath>

#include "core/stumpff.h"
#include "stress/stress.h"

namespace hsi4d {

namespace {

/// C3: coefficients of a rotation and their derivatives by the squared angle, against sums of the series in long
/// double.
std::vector<StressFigure> coefficients(Remedy remedy) {
  const auto series = [](int k, long double x, bool derivative) {  // Σ (−x)^j / (2j + k)!, or its derivative
    long double sum = 0, term = 1;
    for (int n = 1; n <= k; ++n) term /= n;
    for (int j = 0; j < 60; ++j) {
      sum += derivative ? (j == 0 ? 0.0L : j * term / x) : term;
      term *= -x / ((2 * j + k + 1) * (2 * j + k + 2));
    }
    return sum;
  };
  double value = 0, slope = 0;
  for (double t = 1e-8; t < 3.1; t *= 1.05) {
    const float angle = static_cast<float>(t), x = angle * angle;
    float c2, d_c2;
    if (remedy == Remedy::kOn) {
      const Stumpff<float> s = stumpff(x);
      c2 = s.c2;
      d_c2 = s.d_c2();
    } else {  // (1 − cos t)/t² and what it gives when it is differentiated
      c2 = (1 - std::cos(angle)) / x;
      d_c2 = (std::sin(angle) / angle / 2 - c2) / x;
    }
    const auto off = [](float a, long double b) { return std::abs(static_cast<double>((a - b) / b)); };
    value = std::max(value, off(c2, series(2, x, false)));
    slope = std::max(slope, off(d_c2, series(2, x, true)));
  }
  return {{"relative error of (1 - cos t)/t^2", value, 4 * 1.19e-7}, {"relative error of its derivative", slope, 1e-5}};
}

}  // namespace

std::span<const StressCase> rotation_cases() {
  static constexpr std::array kCases = {
      StressCase{"C3", "1 - cos t cancels, its derivative more so", "series and half angles", coefficients},
  };
  return kCases;
}

}  // namespace hsi4d
