#include "core/vector_exp.h"

#include <cmath>
#include <limits>

#include <catch2/catch.hpp>

#include "tests/support/measures.h"

namespace vector_exp_test {

using namespace hsi4d;

namespace {

/// Largest error in units of the last place over [low, high].
template <class S>
double worst_ulps(double low, double high, int steps) {
  double worst = 0;
  for (int i = 0; i <= steps; ++i) {
    const S x = static_cast<S>(low + (high - low) * i / steps);
    const long double exact = std::exp(static_cast<long double>(x));
    const S rounded = static_cast<S>(exact);
    const double ulp = static_cast<double>(std::nextafter(rounded, std::numeric_limits<S>::infinity()) - rounded);
    worst = test::larger(worst, static_cast<double>(std::fabs(static_cast<long double>(vector_exp(x)) - exact)) / ulp);
  }
  return worst;
}

}  // namespace

TEST_CASE("B17: the vector exponential is within 2 ulp over the whole range") {
  CHECK(worst_ulps<float>(-87, 88.7, 2000003) < 2);
  CHECK(worst_ulps<float>(-1e-3, 1e-3, 100003) < 2);
  CHECK(worst_ulps<double>(-708, 709.7, 2000003) < 2);
  CHECK(worst_ulps<double>(-1e-3, 1e-3, 100003) < 2);
}

TEMPLATE_TEST_CASE("B17: the vector exponential at its ends", "", float, double) {
  using Limits = std::numeric_limits<TestType>;
  CHECK(vector_exp(TestType(0)) == 1);
  CHECK(vector_exp(TestType(-0.0)) == 1);
  CHECK(vector_exp(-Limits::infinity()) == 0);
  CHECK(vector_exp(Limits::infinity()) == Limits::infinity());
  CHECK(vector_exp(Limits::max()) == Limits::infinity());
  CHECK(vector_exp(Limits::lowest()) == 0);
  CHECK(vector_exp(Limits::denorm_min()) == 1);
  CHECK(std::isnan(vector_exp(Limits::quiet_NaN())));
  const TestType last = std::nextafter(std::log(Limits::max()), TestType(0));
  CHECK(vector_exp(last) < Limits::infinity());
  CHECK(vector_exp(last * TestType(1.001)) == Limits::infinity());
}

}  // namespace vector_exp_test
