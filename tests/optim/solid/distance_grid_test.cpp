#include "optim/solid/distance_grid.h"

#include <atomic>
#include <cmath>
#include <limits>

#include "autodiff/reduce.h"
#include "core/parallel.h"
#include "core/random.h"
#include "tests/support/operator_check.h"

namespace distance_grid_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

using Point = Vector3<double>;

/// A half space under a slope, and how many times its distance was asked for.
struct HalfSpace {
  std::atomic<Index> asked{0};
  static double distance(const Point& p) { return (0.6 * p[0] + 0.8 * p[2]) - 0.1; }
};

std::shared_ptr<DistanceGrid> half_space(DistanceGrid::Settings settings = {}, HalfSpace* counted = nullptr) {
  return std::make_shared<DistanceGrid>(
      [counted](const Point& p) {
        if (counted != nullptr) ++counted->asked;
        return HalfSpace::distance(p);
      },
      settings);
}

Point random_point(RandomSequence& random) {
  return {random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1)};
}

}  // namespace

TEST_CASE("a distance that is linear is interpolated exactly, its gradient too") {
  const auto grid = half_space({.cell = 0.05, .reach = 10, .name = {}});
  RandomSequence random(1);
  for (int i = 0; i < 500; ++i) {
    const Point p = random_point(random);
    const DistanceSample sample = grid->at(p);
    CHECK(sample.distance == Approx(HalfSpace::distance(p)).margin(1e-6));
    CHECK((sample.gradient - Point(0.6, 0, 0.8)).norm() < 1e-5);
  }
}

TEST_CASE("a distance that is curved is interpolated to the square of the cell") {
  const auto sphere = [](const Point& p) { return p.norm() - 0.5; };
  const auto error = [&](double cell) {
    DistanceGrid grid(sphere, {.cell = cell, .reach = 10, .name = {}});
    RandomSequence random(2);
    double largest = 0;
    for (int i = 0; i < 2000; ++i) {
      Point p = random_point(random);
      p *= 0.5 / p.norm();
      largest = std::max(largest, std::fabs(grid.at(p).distance));
    }
    return largest;
  };
  CHECK(error(0.04) < 0.04 * 0.04 / 0.5);
  CHECK(error(0.02) < 0.3 * error(0.04));
}

TEST_CASE("blocks are sampled where points come, once, and take memory only near the surface") {
  HalfSpace counted;
  const auto grid = half_space({.cell = 0.05, .reach = 0.1, .name = {}}, &counted);
  CHECK(counted.asked == 0);
  CHECK(grid->memory_bytes() == 0);
  grid->at({0, 0, 0.1});
  CHECK(grid->blocks() == 1);
  CHECK(grid->sampled_blocks() == 1);
  CHECK(counted.asked == 1 + 9 * 9 * 9);
  const Index bytes = grid->memory_bytes();
  CHECK(bytes >= 9 * 9 * 9 * 4);
  grid->at({0.01, 0, 0.11});  // the same block
  CHECK(counted.asked == 1 + 9 * 9 * 9);
  CHECK(grid->at({0, 0, 3}).distance == kFarDistance);
  CHECK(grid->at({0, 0, 3}).gradient == Point::Zero());
  CHECK(grid->blocks() == 2);
  CHECK(grid->sampled_blocks() == 1);
  CHECK(counted.asked == 2 + 9 * 9 * 9);
  CHECK(grid->memory_bytes() < bytes + 100);
}

TEST_CASE("a grid that would take too much memory is refused") {
  const auto grid = half_space({.cell = 0.05, .reach = 0.1, .most_bytes = 1 << 13, .name = "loss penetration"});
  grid->at({0, 0, 0.1});
  grid->at({0, 1, 0.1});
  CHECK_THROWS_WITH(grid->at({0, 2, 0.1}),
                    "loss penetration: its grid of cells of 0.05 m takes more than 0.0078125 MiB; larger cells take "
                    "less");
}

TEST_CASE("places that are far away or not finite have no block, and unknown nodes make their cells free") {
  const auto grid = half_space({.cell = 0.05, .reach = 0.1, .name = {}});
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK(grid->block_number({nan, 0, 0}) == DistanceGrid::kNoBlock);
  CHECK(grid->block_number({0, 1e9, 0}) == DistanceGrid::kNoBlock);
  CHECK(grid->at({0, -1e300, 0}).distance == kFarDistance);
  CHECK(grid->blocks() == 0);
  DistanceGrid unknown([nan](const Point& p) { return p[2] < -0.11 ? nan : p[2]; },
                       {.cell = 0.05, .reach = 0.1, .name = {}});
  CHECK(unknown.at({0.01, 0.02, -0.09}).distance == Approx(-0.09).margin(1e-6));
  CHECK(unknown.at({0.01, 0.02, -0.13}).distance == kFarDistance);
}

TEST_CASE("blocks are told apart on both sides of the origin and at their edges") {
  DistanceGrid grid([](const Point& p) { return p[0] + 2 * p[1] - p[2]; }, {.cell = 0.1, .reach = 100, .name = {}});
  for (const double x : {-0.8, -0.8 + 1e-12, -1e-12, 0.0, 1e-12, 0.8, 0.1 * 8, 0.3 / 3 * 24, 1.6}) {
    const Point p(x, -x, 0.7);
    CHECK(grid.at(p).distance == Approx(-x - 0.7).margin(1e-6));
  }
}

TEST_CASE("sampled_distance passes the operator checks", "[parallel]") {
  const auto grid = std::make_shared<DistanceGrid>([](const Point& p) { return p.norm() - 0.7; },
                                                   DistanceGrid::Settings{.cell = 0.11, .reach = 0.4, .name = {}});
  check_operator("sampled_distance", {{"points", shape_of(150, 3)}},
                 [&](const auto& in) { return sampled_distance(in[0], grid); },
                 {.step = 1e-4});  // few points so near to another cell
}

TEST_CASE("sampled_distance gives the same bits in whatever order its grid was filled, and NaN for NaN") {
  const auto value = [](std::shared_ptr<DistanceGrid> grid, int threads) {
    std::vector<double> distances;
    with_threads(threads, [&] {
      Tape<double> tape;
      const auto points = tape.parameter("points", shape_of(300, 3));
      RandomSequence random(7);
      const Array<double> x = tape.write(points);
      for (Index p = 0; p < 300; ++p) {
        for (Index i = 0; i < 3; ++i) x(p, i) = random.uniform(-1, 1);
      }
      x(5, 1) = std::numeric_limits<double>::quiet_NaN();
      const auto d = sampled_distance(points, grid);
      tape.forward(d);
      for (Index p = 0; p < 300; ++p) distances.push_back(tape.value(d)(p, 0));
    });
    CHECK(std::isnan(distances[5]));
    distances[5] = 0;
    return distances;
  };
  const DistanceGrid::Settings settings{.cell = 0.07, .reach = 0.1, .name = {}};
  const std::vector<double> once = value(half_space(settings), 1);
  const auto filled = half_space(settings);
  RandomSequence random(8);
  for (int i = 0; i < 50; ++i) filled->at(random_point(random));
  CHECK(value(filled, 1) == once);
  CHECK(value(half_space(settings), 3) == once);
}

}  // namespace distance_grid_test
