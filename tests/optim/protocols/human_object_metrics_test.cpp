#include "optim/protocols/human_object_metrics.h"

#include <cmath>
#include <limits>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/parallel.h"
#include "core/random.h"
#include "optim/protocols/surface_points.h"
#include "tests/optim/protocols/protocol_reference.h"
#include "tests/support/random_numbers.h"

namespace human_object_metrics_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

using Sides = std::array<PlainFrames, 2>;  // human, object

PlainPoints cloud(std::size_t count, std::uint64_t seed, double size = 1) {
  RandomNumbers random(seed);
  PlainPoints points(count);
  for (PlainPoint& point : points) point = {random(-size, size), random(-size, size), random(-size, size)};
  return points;
}

/// Two clouds that move, and an estimate of them that is elsewhere, turned, smaller and noisy.
struct Scenes {
  Sides estimate, truth;
};

Scenes some_scenes(std::size_t frames, std::uint64_t seed) {
  RandomNumbers random(seed);
  const PlainPoints human = cloud(40, seed + 100), object = cloud(15, seed + 200, 0.3);
  const double angle = random(-3, 3), c = std::cos(angle), n = std::sin(angle), s = random(0.6, 1.5);
  Scenes scenes;
  for (std::size_t t = 0; t < frames; ++t) {
    const std::array<const PlainPoints*, 2> clouds = {&human, &object};
    for (std::size_t side = 0; side < 2; ++side) {
      PlainPoints truth, estimate;
      const PlainPoint shift = {random(), random(), random()};
      for (PlainPoint point : *clouds[side]) {
        for (std::size_t i = 0; i < 3; ++i) point[i] += 0.1 * shift[i] + random(-0.02, 0.02);
        truth.push_back(point);
        estimate.push_back({s * (c * point[0] - n * point[1]) + 4 + random(-0.1, 0.1),
                            s * (n * point[0] + c * point[1]) - 9 + random(-0.1, 0.1),
                            s * point[2] + random(-0.1, 0.1) + (side == 1 ? 0.2 : 0)});
      }
      scenes.truth[side].push_back(truth);
      scenes.estimate[side].push_back(estimate);
    }
  }
  return scenes;
}

HumanObjectMotion motion_of(const Sides& sides) {
  HumanObjectMotion motion;
  for (const PlainPoints& points : sides[0]) motion.human.push_back(numbers_of(points));
  for (const PlainPoints& points : sides[1]) motion.object.push_back(numbers_of(points));
  return motion;
}

PlainPoints both(const PlainPoints& a, const PlainPoints& b) {
  PlainPoints all = a;
  all.insert(all.end(), b.begin(), b.end());
  return all;
}

void check_close(double number, double wanted) { CHECK(std::fabs(number - wanted) <= 1e-9); }

void check_scenes(const Scenes& scenes, Index window) {
  const HumanObjectErrors errors = human_object_errors(motion_of(scenes.estimate), motion_of(scenes.truth), {}, window);
  const auto frames = static_cast<std::size_t>(window);
  const Sides laid = plain_laid(scenes.estimate, scenes.truth, frames);
  std::vector<double> human, object, together;
  for (std::size_t t = 0; t < laid[0].size(); ++t) {
    human.push_back(plain_chamfer(laid[0][t], scenes.truth[0][t]));
    object.push_back(plain_chamfer(laid[1][t], scenes.truth[1][t]));
    together.push_back(plain_chamfer(both(laid[0][t], laid[1][t]), both(scenes.truth[0][t], scenes.truth[1][t])));
  }
  check_close(errors.cd_human, 100 * plain_mean(human));
  check_close(errors.cd_object, 100 * plain_mean(object));
  check_close(errors.cd_both, 100 * plain_mean(together));
  if (std::min(laid[0].size(), frames) < 3) {
    CHECK_FALSE((errors.acceleration_human || errors.acceleration_object));
    return;
  }
  check_close(*errors.acceleration_human, 100 * plain_acceleration(laid[0], scenes.truth[0], frames));
  check_close(*errors.acceleration_object, 100 * plain_acceleration(laid[1], scenes.truth[1], frames));
}

/// As tests/optim/protocols/protocol_numbers.py has it.
PlainFrames waves(std::size_t frames, std::size_t points, double phase, double size) {
  PlainFrames all(frames, PlainPoints(points));
  for (std::size_t t = 0; t < frames; ++t) {
    for (std::size_t p = 0; p < points; ++p) {
      for (std::size_t c = 0; c < 3; ++c) {
        const auto x = static_cast<double>(t), y = static_cast<double>(p), z = static_cast<double>(c);
        all[t][p][c] = size * std::sin(0.37 * x + 1.1 * y + 2.3 * z + phase) + 0.02 * x * (z + 1);
      }
    }
  }
  return all;
}

}  // namespace

TEST_CASE("chamfer distances are those of looking at all points") {
  for (const std::size_t count : {1, 2, 3, 10, 11, 57, 400}) {
    const PlainPoints a = cloud(count, count), b = cloud(2 * count + 1, count + 1);
    check_close(chamfer_distance(numbers_of(a), numbers_of(b)), plain_chamfer(a, b));
    CHECK(chamfer_distance(numbers_of(a), numbers_of(a)) == 0);
  }
  const PlainPoints same(20, {1, 2, 3}), line = {{0, 0, 0}, {0, 0, 1}, {0, 0, 2}};
  check_close(chamfer_distance(numbers_of(same), numbers_of(line)), plain_chamfer(same, line));
  std::vector<double> broken = numbers_of(line);
  broken[4] = std::numeric_limits<double>::quiet_NaN();
  CHECK(std::isnan(chamfer_distance(broken, numbers_of(line))));
  CHECK_THROWS_AS(chamfer_distance({}, broken), InternalError);
}

TEST_CASE("human and object are measured as by the independent protocol") {
  std::uint64_t seed = 1;
  for (const std::size_t frames : {1, 2, 3, 7}) {
    for (const Index window : {1, 2, 3, 5, 300}) {
      INFO(frames << " frames in pieces of " << window);
      check_scenes(some_scenes(frames, seed++), window);
    }
  }
}

TEST_CASE("human and object are measured as by NumPy") {
  // tests/optim/protocols/protocol_numbers.py
  const Sides estimate = {waves(10, 30, 0.4, 0.6), waves(10, 12, 0.9, 0.3)},
              truth = {waves(10, 30, 0, 0.5), waves(10, 12, 0.7, 0.35)};
  const HumanObjectErrors errors = human_object_errors(motion_of(estimate), motion_of(truth), {}, 4);
  check_close(errors.cd_human, 11.398442217399744);
  check_close(errors.cd_object, 24.497181779768574);
  check_close(errors.cd_both, 15.13448556755757);
  check_close(*errors.acceleration_human, 0.870297395130751);
  check_close(*errors.acceleration_object, 1.7351108192942228);
}

TEST_CASE("degenerate humans and objects") {
  Scenes flat = some_scenes(4, 31);
  for (Sides* const sides : {&flat.estimate, &flat.truth}) {
    for (PlainFrames& part : *sides) {
      for (PlainPoints& points : part) {
        for (PlainPoint& point : points) point[2] = 1;
      }
    }
  }
  check_scenes(flat, 300);
  Scenes one_place = some_scenes(3, 32);
  for (PlainFrames& part : one_place.estimate) {
    for (PlainPoints& points : part) points.assign(points.size(), {5, 5, 5});
  }
  check_scenes(one_place, 300);
}

TEST_CASE("surfaces are compared by points that are drawn from them") {
  Scenes scenes = some_scenes(2, 41);
  for (Sides* const sides : {&scenes.estimate, &scenes.truth}) {
    for (PlainFrames& part : *sides) {
      for (PlainPoints& points : part) points.resize(4);
    }
  }
  const Triangles faces = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  const HumanObjectErrors errors =
      human_object_errors(motion_of(scenes.estimate), motion_of(scenes.truth), {faces, faces});
  const Sides laid = plain_laid(scenes.estimate, scenes.truth, 300);
  const auto drawn = [&](const PlainPoints& vertices, std::size_t frame, const char* stream) {
    return plain_of(surface_points(numbers_of(vertices), faces, kSurfacePoints, {frame, random_stream(stream)}));
  };
  std::vector<double> human;
  for (std::size_t t = 0; t < 2; ++t)
    human.push_back(
        plain_chamfer(drawn(laid[0][t], t, "metrics.estimate.human"), drawn(scenes.truth[0][t], t, "metrics.human")));
  check_close(errors.cd_human, 100 * plain_mean(human));
  // What is equal has the distance of points that are drawn twice: A evenly drawn points of one square metre are on
  // average 0.5 / sqrt(A) from the nearest of as many others; both ways, that is 1 / sqrt(A).
  const PlainPoints sheet = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  const Triangles halves = {{0, 1, 2}, {0, 2, 3}};
  const HumanObjectMotion still = motion_of({PlainFrames(2, sheet), PlainFrames(2, sheet)});
  const HumanObjectErrors floor = human_object_errors(still, still, {halves, halves});
  CHECK(floor.cd_human == Approx(1).epsilon(0.05));
  CHECK(floor.cd_object == Approx(1).epsilon(0.05));
  CHECK(floor.cd_both == Approx(std::sqrt(0.5)).epsilon(0.05));
  CHECK(human_object_errors(still, still, {}).cd_both == Approx(0).margin(1e-9));
}

TEST_CASE("humans and objects have the same bits for any number of threads", "[parallel]") {
  const Scenes scenes = some_scenes(9, 61);
  const Triangles faces = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  std::vector<double> one;
  for (const int threads : {1, 2, 3, 8}) {
    with_threads(threads, [&] {
      const HumanObjectErrors e =
          human_object_errors(motion_of(scenes.estimate), motion_of(scenes.truth), {{}, faces}, 4);
      const std::vector<double> all = {e.cd_human, e.cd_object, e.cd_both, *e.acceleration_human};
      if (one.empty()) one = all;
      CHECK(all == one);
    });
  }
}

TEST_CASE("humans and objects whose sizes differ are mistakes") {
  const Scenes scenes = some_scenes(3, 51);
  const HumanObjectMotion estimate = motion_of(scenes.estimate), truth = motion_of(scenes.truth);
  HumanObjectMotion shorter = truth, without = truth, other = truth;
  shorter.object.pop_back();
  without.object.assign(3, {});
  other.human[1].resize(30);
  CHECK_THROWS_AS(human_object_errors(estimate, shorter, {}), InternalError);
  CHECK_THROWS_AS(human_object_errors(without, without, {}), InternalError);
  CHECK_THROWS_AS(human_object_errors(estimate, other, {}), InternalError);
  CHECK_THROWS_AS(human_object_errors(estimate, truth, {}, 0), InternalError);
  CHECK_THROWS_AS(human_object_errors({}, {}, {}), InternalError);
}

}  // namespace human_object_metrics_test
