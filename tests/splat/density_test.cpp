#include "splat/density.h"

#include <cmath>

#include <catch2/catch.hpp>

#include "core/check.h"

namespace density_test {

using namespace hsi4d;

namespace {

/// ∫ 1 − (1 − o G(x/s))^N dx along a line, by the trapezoidal rule, which is exact to rounding for such bells.
double integral(double opacity, double scale, Index copies) {
  double sum = 0;
  constexpr double kStep = 1.0 / 64, kReach = 12;
  for (double x = -kReach; x <= kReach; x += kStep) {
    const double alpha = opacity * std::exp(-0.5 * (x / scale) * (x / scale));
    sum -= std::expm1(static_cast<double>(copies) * std::log1p(-alpha));
  }
  return sum * kStep;
}

}  // namespace

TEST_CASE("Gaussians that share a place show what one showed, at its centre and along a line") {
  for (const double opacity : {1e-4, 0.005, 0.1, 0.5, 0.9, 0.99, 0.9999}) {
    for (const Index copies : {1, 2, 3, 7, 20, 51}) {
      CAPTURE(opacity, copies);
      const SharedShape shared = shared_shape(opacity, copies);
      CHECK(-std::expm1(static_cast<double>(copies) * std::log1p(-shared.opacity)) == Approx(opacity).epsilon(1e-12));
      CHECK(integral(shared.opacity, shared.scale, copies) == Approx(integral(opacity, 1, 1)).epsilon(1e-7));
    }
  }
}

TEST_CASE("what is opaque or not there is shared without a number that is none") {
  const SharedShape opaque = shared_shape(1, 2);
  CHECK(opaque.opacity == Approx(1 - 1e-3).epsilon(1e-6));
  CHECK(std::isfinite(opaque.scale));
  const SharedShape nothing = shared_shape(0, 5);
  CHECK(nothing.opacity == 0);
  CHECK(nothing.scale == 1);
  CHECK_THROWS_AS(shared_shape(0.5, 0), InternalError);
  CHECK_THROWS_AS(shared_shape(0.5, kMostCopies + 1), InternalError);
  CHECK_THROWS_AS(shared_shape(1.5, 2), InternalError);
}

}  // namespace density_test
