#include "core/stumpff.h"

#include <array>
#include <cmath>
#include <limits>

#include <catch2/catch.hpp>

#include "stress/rotation_measures.h"

namespace stumpff_test {

using namespace hsi4d;
using stress::relative;
using stress::stumpff_series;
using stress::ulps;

namespace {

std::array<double, 5> all(const Stumpff<double>& c) { return {c.c1, c.c2, c.c3, c.c4, c.c5}; }

template <class Visit>
void for_angles(double from, double to, double factor, const Visit& visit) {
  for (double t = from; t <= to; t *= factor) visit(t);
}

}  // namespace

TEST_CASE("C3: the coefficients are within 4 ulp in their own precision") {
  std::array<double, 5> worst{};
  double worst_derivative = 0, c1_absolute = 0;
  for_angles(1e-8, 11.0, 1.003, [&](double t) {
    const double x = t * t;
    const Stumpff<double> c = stumpff(x);
    for (std::size_t k = 0; k < 5; ++k) {
      const long double exact = stumpff_series(static_cast<int>(k) + 1, x);
      if (k == 0 && t > 2.5) {  // relative error means nothing near the zeros at multiples of π
        c1_absolute = std::fmax(c1_absolute, static_cast<double>(std::fabs(all(c)[0] - exact)));
      } else if (k == 1 && t > 5) {  // the same at 2π
        c1_absolute = std::fmax(c1_absolute, static_cast<double>(std::fabs(all(c)[1] - exact)));
      } else {
        worst[k] = std::fmax(worst[k], ulps(all(c)[k], exact));
      }
    }
    if (t > 3.2) return;
    worst_derivative = std::fmax(worst_derivative, relative(c.d_c1(), stumpff_series(1, x, true)));
    worst_derivative = std::fmax(worst_derivative, relative(c.d_c2(), stumpff_series(2, x, true)));
    worst_derivative = std::fmax(worst_derivative, relative(c.d_c3(), stumpff_series(3, x, true)));
  });
  CAPTURE(worst[0], worst[1], worst[2], worst[3], worst[4], c1_absolute, worst_derivative);
  for (const double w : worst) CHECK(w <= 4);
  CHECK(c1_absolute <= 2.3e-16);
  CHECK(worst_derivative <= 4e-15);
}

TEST_CASE("M5: the textbook quotients have the errors of the table, these functions have none") {
  const auto chord = [](float t) { return (1 - std::cos(t)) / (t * t); };
  const auto cubic = [](float t) { return (t - std::sin(t)) / (t * t * t); };
  const auto error = [](float value, int k, float t) {
    return relative(value, stumpff_series(k, static_cast<long double>(t) * t));
  };
  CHECK(error(chord(1e-4f), 2, 1e-4f) == Approx(1));
  CHECK(error(chord(1e-3f), 2, 1e-3f) > 0.03);
  CHECK(error(cubic(1e-3f), 3, 1e-3f) > 0.1);
  for (const float t : {1e-5f, 1e-4f, 3e-4f, 1e-3f, 3.4e-3f, 0.3f, 1.0f}) {
    const Stumpff<float> c = stumpff(t * t);  // float arithmetic throughout
    CAPTURE(t);
    CHECK(error(c.c1, 1, t) <= 2.5e-7);
    CHECK(error(c.c2, 2, t) <= 2.5e-7);
    CHECK(error(c.c3, 3, t) <= 2.5e-7);
    CHECK(relative(c.d_c1(), stumpff_series(1, static_cast<long double>(t) * t, true)) <= 1e-5);
    CHECK(relative(c.d_c2(), stumpff_series(2, static_cast<long double>(t) * t, true)) <= 1e-5);
  }
}

TEST_CASE("C4: both formulas are within 4 ulp on both sides of every switch") {
  double worst = 0;
  const auto compare = [&](double value, int k, double x) {
    worst = std::fmax(worst, ulps(value, stumpff_series(k, x)));
  };
  for (double x = 0.5 * kStumpffSines; x <= 2 * kStumpffSines; x *= 1.001) {
    const Stumpff<double> sines = detail::stumpff_from_sines(x);
    compare(sines.c1, 1, x);
    compare(sines.c2, 2, x);
    compare(1 - x * detail::stumpff_series<3>(x), 1, x);
    compare(0.5 - x * detail::stumpff_series<4>(x), 2, x);
  }
  CHECK(worst <= 4);
  worst = 0;
  for (double x = 0.5 * kStumpffSeries; x <= 2 * kStumpffSeries; x *= 1.001) {
    Stumpff<double> doubled{};
    detail::add_doubled(stumpff(x / 4), doubled);
    compare(doubled.c3, 3, x);
    compare(doubled.c4, 4, x);
    compare(doubled.c5, 5, x);
    compare(detail::stumpff_series<3>(x), 3, x);
    compare(detail::stumpff_series<4>(x), 4, x);
    compare(detail::stumpff_series<5>(x), 5, x);
  }
  CHECK(worst <= 4);
  worst = 0;
  for (double x = 0.5 * kStumpffDouble; x <= 2 * kStumpffDouble; x *= 1.001) {
    Stumpff<double> doubled{};
    detail::add_doubled(stumpff(x / 4), doubled);
    compare(doubled.c3, 3, x);
    compare(doubled.c4, 4, x);
    compare(doubled.c5, 5, x);
    Stumpff<double> quotients = detail::stumpff_from_sines(x);
    detail::add_quotients(x, quotients);
    compare(quotients.c3, 3, x);
    compare(quotients.c4, 4, x);
    compare(quotients.c5, 5, x);
  }
  CHECK(worst <= 4);
}

TEST_CASE("the Stumpff functions at 0 are the inverse factorials, and not a number passes through") {
  const Stumpff<float> c = stumpff(0.0f);
  CHECK(c.c1 == 1.0f);
  CHECK(c.c2 == 0.5f);
  CHECK(c.c3 == 1.0f / 6);
  CHECK(c.c4 == 1.0f / 24);
  CHECK(c.c5 == 1.0f / 120);
  CHECK(std::isnan(stumpff(std::numeric_limits<double>::quiet_NaN()).c3));
  CHECK(std::isnan(stumpff(std::numeric_limits<double>::infinity()).c1));
}

}  // namespace stumpff_test
