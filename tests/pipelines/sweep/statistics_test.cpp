#include "pipelines/sweep/statistics.h"

#include <array>
#include <cmath>
#include <vector>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/random.h"

namespace statistics_test {

using namespace hsi4d;

TEST_CASE("mean and deviation of a sample by hand") {
  const std::array<double, 4> values = {2, 4, 4, 10};
  const SampleStatistics sample = sample_statistics(values);
  CHECK(sample.count == 4);
  CHECK(sample.mean == 5);
  CHECK(sample.deviation == std::sqrt(36.0 / 3));  // 9 + 1 + 1 + 25
  CHECK(sample_statistics({}).mean == 0);
  CHECK(sample_statistics(std::span(values).first(1)).mean == 2);
  CHECK(sample_statistics(std::span(values).first(1)).deviation == 0);
}

TEST_CASE("quantiles lie between neighbours") {
  const std::array<double, 5> values = {1, 2, 4, 8, 16};
  CHECK(quantile(values, 0) == 1);
  CHECK(quantile(values, 0.5) == 4);
  CHECK(quantile(values, 0.125) == 1.5);
  CHECK(quantile(values, 0.9) == Approx(8 + 0.6 * 8));
  CHECK(quantile(values, 1) == 16);
  CHECK_THROWS_AS(quantile({}, 0.5), InternalError);
}

TEST_CASE("the bootstrap of two values is made of three means") {
  // Means of two draws from {0, 1}: 0 with 1/4, 1/2 with 1/2, 1 with 1/4.
  const std::array<double, 2> values = {0, 1};
  const auto wide = bootstrap_interval(values, 0.95), narrow = bootstrap_interval(values, 0.4);
  REQUIRE(wide);
  CHECK(wide->low == 0);
  CHECK(wide->high == 1);
  CHECK(narrow->low == 0.5);
  CHECK(narrow->high == 0.5);
  CHECK_FALSE(bootstrap_interval(std::span(values).first(1)));
  const std::array<double, 3> equal = {0.1, 0.1, 0.1};
  CHECK(bootstrap_interval(equal)->low == Approx(0.1).epsilon(1e-15));
}

TEST_CASE("the bootstrap's interval is that of the normal distribution for many values") {
  std::vector<double> values;
  for (std::uint64_t i = 0; i < 200; ++i) values.push_back(3 + 2 * Random(5).normal(i));
  const SampleStatistics sample = sample_statistics(values);
  const double half = 1.96 * sample.deviation / std::sqrt(200.0);
  const auto interval = bootstrap_interval(values);
  REQUIRE(interval);
  CHECK(interval->low == Approx(sample.mean - half).margin(0.1 * half));
  CHECK(interval->high == Approx(sample.mean + half).margin(0.1 * half));
  const auto again = bootstrap_interval(values);
  CHECK(again->low == interval->low);
  CHECK(again->high == interval->high);
}

}  // namespace statistics_test
