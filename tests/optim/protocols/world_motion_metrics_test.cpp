#include "optim/protocols/world_motion_metrics.h"

#include <cmath>
#include <limits>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "optim/metrics.h"
#include "optim/similarity.h"
#include "tests/optim/protocols/protocol_reference.h"
#include "tests/support/random_numbers.h"

namespace world_motion_metrics_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

constexpr std::size_t kCounted = 22;

double mean_of_errors(const std::vector<double>& numbers) { return plain_mean(numbers); }

/// As the script of the same name has it.
PlainFrames waves(std::size_t frames, std::size_t points, double phase, double size, double drift = 0.02) {
  PlainFrames all(frames, PlainPoints(points));
  for (std::size_t t = 0; t < frames; ++t) {
    for (std::size_t p = 0; p < points; ++p) {
      for (std::size_t c = 0; c < 3; ++c) {
        const auto x = static_cast<double>(t), y = static_cast<double>(p), z = static_cast<double>(c);
        all[t][p][c] = size * std::sin(0.37 * x + 1.1 * y + 2.3 * z + phase) + drift * x * (z + 1);
      }
    }
  }
  return all;
}

/// A body that goes somewhere, and an estimate of it: elsewhere, turned, of another size, drifting, noisy.
struct Motions {
  PlainFrames estimate, truth;
};

Motions some_motions(std::size_t frames, std::size_t joints, std::uint64_t seed, double apart = 3) {
  RandomNumbers random(seed);
  const double s = random(0.7, 1.4), angle = random(-3, 3), c = std::cos(angle), n = std::sin(angle);
  PlainPoint speed = {random(-0.03, 0.03), random(-0.03, 0.03), random(-0.01, 0.01)}, place = {};
  const PlainPoint away = {random(-apart, apart), random(-apart, apart), random(-apart, apart)};
  Motions motions;
  PlainPoints body;
  for (std::size_t j = 0; j < joints; ++j) body.push_back({random(), random(), random()});
  for (std::size_t t = 0; t < frames; ++t) {
    PlainPoints truth, estimate;
    for (std::size_t i = 0; i < 3; ++i) {
      speed[i] += random(-0.005, 0.005);
      place[i] += speed[i];
    }
    for (PlainPoint joint : body) {
      for (std::size_t i = 0; i < 3; ++i) joint[i] += place[i] + random(-0.1, 0.1);
      truth.push_back(joint);
      estimate.push_back({s * (c * joint[0] - n * joint[2]) + away[0] + random(-0.05, 0.05),
                          s * joint[1] + away[1] + 0.002 * static_cast<double>(t) + random(-0.05, 0.05),
                          s * (n * joint[0] + c * joint[2]) + away[2] + random(-0.05, 0.05)});
    }
    motions.truth.push_back(truth);
    motions.estimate.push_back(estimate);
  }
  return motions;
}

void check_near(const std::vector<double>& numbers, const std::vector<double>& wanted, double unit) {
  REQUIRE(numbers.size() == wanted.size());
  for (std::size_t i = 0; i < numbers.size(); ++i) CHECK(std::fabs(numbers[i] - unit * wanted[i]) <= 1e-9);
}

void check_pieces(const Motions& motions) {
  const FrameArrays estimate(motions.estimate), truth(motions.truth);
  const std::size_t counted = std::min(motions.truth[0].size(), kCounted);
  const PlainFrames own = first_of_each(motions.estimate, counted), its = first_of_each(motions.truth, counted);
  check_near(piecewise_mpjpe_mm(estimate.spans, truth.spans, kPieceFrames, kPieceFrames),
             plain_piece_errors(own, its, 100, 100), 1000);
  check_near(piecewise_mpjpe_mm(estimate.spans, truth.spans, kPieceFrames, kFirstFrames),
             plain_piece_errors(own, its, 100, 2), 1000);
}

void check_way(const Motions& motions) {
  const FrameArrays estimate(motions.estimate), truth(motions.truth);
  PlainPoints own, its;
  for (std::size_t t = 0; t < motions.truth.size(); ++t) {
    own.push_back(motions.estimate[t][0]);
    its.push_back(motions.truth[t][0]);
  }
  const auto errors = root_way_errors_percent(estimate.spans, truth.spans);
  REQUIRE(errors);
  check_near(*errors, plain_way_errors(own, its), 1);
}

}  // namespace

TEST_CASE("pieces of 100 frames are those of the independent protocol") {
  std::uint64_t seed = 1;
  for (const std::size_t frames : {1, 2, 3, 99, 100, 101, 102, 200, 250}) {
    INFO(frames);
    check_pieces(some_motions(frames, 24, seed++));
    check_pieces(some_motions(frames, 5, seed++));
  }
  check_pieces(some_motions(130, 22, 91, 1000));  // a world whose origin is far away
}

TEST_CASE("pieces of points that lie in a plane, of mirrored ones, and of one place") {
  Motions flat = some_motions(120, 22, 7);
  for (PlainFrames* const frames : {&flat.estimate, &flat.truth}) {
    for (PlainPoints& points : *frames) {
      for (PlainPoint& point : points) point[2] = 0.5;
    }
  }
  check_pieces(flat);
  Motions mirrored = some_motions(120, 22, 8);
  for (PlainPoints& points : mirrored.estimate) {
    for (PlainPoint& point : points) point[0] = -point[0];
  }
  check_pieces(mirrored);
  Motions one_place = some_motions(5, 22, 9);
  for (PlainPoints& points : one_place.estimate) points.assign(22, {1, 2, 3});
  check_pieces(one_place);
  check_way(one_place);
}

TEST_CASE("what is the truth in another place, heading and size has no error") {
  Motions motions = some_motions(150, 22, 11);
  for (std::size_t t = 0; t < motions.truth.size(); ++t) {
    for (std::size_t j = 0; j < 22; ++j) {
      const PlainPoint& x = motions.truth[t][j];
      motions.estimate[t][j] = {3 - 1.3 * x[1], 1.3 * x[0] - 7, 1.3 * x[2] + 1};
    }
  }
  const FrameArrays estimate(motions.estimate), truth(motions.truth);
  for (const Index aligned : {kFirstFrames, kPieceFrames}) {
    for (const double error : piecewise_mpjpe_mm(estimate.spans, truth.spans, kPieceFrames, aligned))
      CHECK(error == Approx(0).margin(1e-9));
  }
  // The way's size counts: it is 1.3 times as long.
  CHECK(mean_of_errors(*root_way_errors_percent(estimate.spans, truth.spans)) > 1);
}

TEST_CASE("the error of the pelvis's way is that of the independent protocol") {
  for (const std::size_t frames : {2, 3, 4, 50, 230}) {
    INFO(frames);
    check_way(some_motions(frames, 22, frames));
  }
  Motions straight = some_motions(60, 3, 21);
  for (std::size_t t = 0; t < 60; ++t) straight.truth[t][0] = {0.02 * static_cast<double>(t), 0, 1};
  check_way(straight);  // any turn about the line is as good, and gives the same errors
  const Motions still = {straight.truth, PlainFrames(60, straight.truth[0])};
  const FrameArrays estimate(still.estimate), truth(still.truth);
  CHECK_FALSE(root_way_errors_percent(estimate.spans, truth.spans));
}

TEST_CASE("steps of feet that stand are those of the independent protocol") {
  for (std::uint64_t seed = 1; seed < 6; ++seed) {
    RandomNumbers random(seed);
    PlainFrames points(40, PlainPoints(4)), feet(40, PlainPoints(4));
    for (std::size_t t = 0; t < 40; ++t) {
      for (std::size_t p = 0; p < 4; ++p) {
        for (std::size_t i = 0; i < 3; ++i) {
          const double size = (t + p) % 7 < 3 ? 0.002 : 0.05;  // stands, or goes
          feet[t][p][i] = (t == 0 ? 0 : feet[t - 1][p][i]) + random(-size, size);
          points[t][p][i] = feet[t][p][i] + random(-0.01, 0.01);
        }
      }
    }
    const FrameArrays own(points), its(feet);
    const std::vector<double> steps = plain_standing_steps(points, feet);
    REQUIRE(steps.size() > 20);
    REQUIRE(steps.size() < 39 * 4);
    CHECK(std::fabs(*standing_step_mm(own.spans, its.spans) - 1000 * plain_mean(steps)) <= 1e-9);
  }
  const PlainFrames from = {{{0, 0, 0}}, {{0, 0, kStandingStep}}};  // exactly as far as is too far
  const FrameArrays frames(from);
  CHECK_FALSE(standing_step_mm(frames.spans, frames.spans));
  const FrameArrays one({{{0, 0, 0}}});
  CHECK_FALSE(standing_step_mm(one.spans, one.spans));
}

TEST_CASE("the protocols' jitter is a tenth of ours at any rate") {
  for (const double rate : {10.0, 23.976, 30.0, 120.0}) {
    const Motions motions = some_motions(17, 22, static_cast<std::uint64_t>(rate));
    const FrameArrays estimate(motions.estimate);
    CHECK(*jitter(estimate.spans, rate) / kJitterUnit == Approx(plain_jitter(motions.estimate, rate)).epsilon(1e-12));
  }
}

TEST_CASE("metrics of protocols are those of NumPy") {
  // tests/optim/protocols/protocol_numbers.py
  const PlainFrames truth = waves(230, 22, 0, 0.5), shifted = waves(230, 22, 0.3, 0.5), more = waves(230, 22, 2, 1);
  PlainFrames own = truth;
  for (std::size_t t = 0; t < 230; ++t) {
    for (std::size_t p = 0; p < 22; ++p) {
      for (std::size_t c = 0; c < 3; ++c) own[t][p][c] = 1.2 * shifted[t][p][(c + 1) % 3] + 0.05 * more[t][p][c];
    }
  }
  const FrameArrays estimate(own), its(truth);
  const auto mean_error = [&](Index aligned) {
    return mean_of_errors(piecewise_mpjpe_mm(estimate.spans, its.spans, kPieceFrames, aligned));
  };
  CHECK(std::fabs(mean_error(kPieceFrames) - 68.76293118159032) <= 1e-9);
  CHECK(std::fabs(mean_error(kFirstFrames) - 424.945714981023) <= 1e-9);
  CHECK(std::fabs(mean_of_errors(*root_way_errors_percent(estimate.spans, its.spans)) - 1.961160883295646) <= 1e-9);
  CHECK(std::fabs(*jitter(estimate.spans, 30) / kJitterUnit - 105.7917054460261) <= 1e-9);
  const FrameArrays feet(waves(230, 4, 0.2, 0.03, 0.001)), true_feet(waves(230, 4, 0.1, 0.02, 0));
  CHECK(std::fabs(*standing_step_mm(feet.spans, true_feet.spans) - 13.626692872552287) <= 1e-9);
}

TEST_CASE("sizes of motions that differ are mistakes, numbers that are not finite give none") {
  const Motions motions = some_motions(4, 22, 3);
  const FrameArrays estimate(motions.estimate), truth(motions.truth);
  const std::span<const std::span<const double>> frames = estimate.spans;
  CHECK_THROWS_AS(piecewise_mpjpe_mm(frames.first(3), truth.spans, 100, 2), InternalError);
  CHECK_THROWS_AS(piecewise_mpjpe_mm(frames, truth.spans, 0, 2), InternalError);
  CHECK_THROWS_AS(root_way_errors_percent(frames.first(3), truth.spans), InternalError);
  CHECK_THROWS_AS(standing_step_mm(frames.first(3), truth.spans), InternalError);
  const FrameArrays other(some_motions(4, 23, 3).truth);
  CHECK_THROWS_AS(standing_step_mm(frames, other.spans), InternalError);
  PlainFrames broken = motions.estimate;
  broken[1][0][2] = std::numeric_limits<double>::quiet_NaN();
  const FrameArrays nan(broken);
  CHECK(std::isnan(piecewise_mpjpe_mm(nan.spans, truth.spans, 100, 2)[0]));
  CHECK(std::isnan((*root_way_errors_percent(nan.spans, truth.spans))[1]));
  CHECK(std::isnan(*standing_step_mm(estimate.spans, nan.spans)));
  CHECK(fit_similarity(nan.spans, truth.spans, FitScale::kOne).scale != 1);
}

}  // namespace world_motion_metrics_test
