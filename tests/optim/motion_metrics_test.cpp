#include "optim/motion_metrics.h"

#include <cmath>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/random.h"
#include "optim/metrics.h"

namespace motion_metrics_test {

using namespace hsi4d;

namespace {

using Frames = std::vector<std::vector<double>>;

std::vector<std::span<const double>> spans_of(const Frames& frames) { return {frames.begin(), frames.end()}; }

Frames random_motion(RandomSequence& random, std::size_t frames, std::size_t joints) {
  Frames motion(frames, std::vector<double>(3 * joints));
  for (auto& frame : motion) {
    for (double& x : frame) x = random.uniform(-1, 1);
  }
  return motion;
}

}  // namespace

TEST_CASE("the acceleration error has the value of a pencil and paper") {
  // x = 3 t² / 2 along x against what stands: 3 m/s² at every moment, whatever the rate.
  for (const double rate : {10.0, 30.0, 60.0, 120.0}) {
    Frames moving, still;
    for (int t = 0; t < 6; ++t) {
      const double s = t / rate;
      moving.push_back({1.5 * s * s, 0, 7, 1.5 * s * s, 2, 7});
      still.push_back({5, 5, 5, 5, 5, 5});
    }
    const std::vector<double> errors = acceleration_errors(spans_of(moving), spans_of(still), rate);
    REQUIRE(errors.size() == 4);
    for (const double error : errors) CHECK(error == Approx(3).epsilon(1e-9));
    for (const double error : acceleration_errors(spans_of(moving), spans_of(moving), rate)) CHECK(error == 0);
  }
}

TEST_CASE("the acceleration error agrees with plain loops and counts 22 joints") {
  RandomSequence random(3);
  const Frames a = random_motion(random, 7, 30), b = random_motion(random, 7, 30);
  const std::vector<double> errors = acceleration_errors(spans_of(a), spans_of(b), 25);
  REQUIRE(errors.size() == 5);
  for (std::size_t t = 1; t < 6; ++t) {
    double sum = 0;
    for (std::size_t j = 0; j < 22; ++j) {
      double squares = 0;
      for (std::size_t i = 3 * j; i < 3 * j + 3; ++i) {
        const double x = (a[t + 1][i] - 2 * a[t][i] + a[t - 1][i]) - (b[t + 1][i] - 2 * b[t][i] + b[t - 1][i]);
        squares += x * x;
      }
      sum += std::sqrt(squares);
    }
    CHECK(errors[t - 1] == Approx(sum / 22 * 625).epsilon(1e-12));
  }
  CHECK(acceleration_errors(spans_of(Frames(a.begin(), a.begin() + 2)), spans_of(Frames(b.begin(), b.begin() + 2)), 10)
            .empty());
  CHECK_THROWS_AS(acceleration_errors(spans_of(a), spans_of(Frames(b.begin(), b.begin() + 6)), 10), InternalError);
}

TEST_CASE("diversity is the mean distance over all pairs of motions") {
  // Three motions of two joints, at 0, 1 and 3 m along x: pairs are 1, 3 and 2 m apart.
  std::vector<Frames> motions;
  for (const double x : {0.0, 1.0, 3.0}) motions.push_back({{x, 0, 0, x, 1, 0}, {x, 0, 0, x, 1, 0}});
  motions[2].push_back({9, 9, 9, 9, 9, 9});  // longer than the others: the rest is not looked at
  std::vector<std::vector<std::span<const double>>> views;
  for (const Frames& motion : motions) views.push_back(spans_of(motion));
  CHECK(*pairwise_distance_mm(views, false) == Approx(2000));
  CHECK(*pairwise_distance_mm(views, true) == Approx(0).margin(1e-12));
  motions[1][0][3] += 0.3;  // one joint of one motion in one frame: of two pairs, half a frame, half a body
  CHECK(*pairwise_distance_mm(views, true) == Approx(300.0 * 2 / 3 / 2 / 2));
  CHECK_FALSE(pairwise_distance_mm(std::span(views).first(1), false).has_value());
  views[0].clear();
  CHECK_FALSE(pairwise_distance_mm(views, false).has_value());
}

}  // namespace motion_metrics_test
