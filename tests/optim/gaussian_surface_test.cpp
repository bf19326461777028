#include "optim/gaussian_surface.h"

#include <cmath>

#include <catch2/catch.hpp>

#include "core/quaternion.h"
#include "core/random.h"
#include "tests/optim/surface_of_test.h"

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

using Point = Vector3<double>;

}  // namespace

TEST_CASE("only opaque and flat Gaussians are surface, with their shortest axis as normal") {
  Gaussians gaussians;
  add_disc(gaussians, {1, 2, 3}, {0, 0.6, 0.8}, 0.05);
  add_disc(gaussians, {0, 0, 0}, {0, 0, 1}, 0.05);
  gaussians.opacity_logits[1] = -0.1f;  // less than half
  add_disc(gaussians, {0, 0, 0}, {0, 0, 1}, 0.05);
  for (std::size_t i = 6; i < 9; ++i) gaussians.log_scales[i] = -3;  // a ball
  gaussians.origin_world = {10, 0, 0};
  const std::vector<SurfaceDisc> discs = surface_discs(gaussians);
  REQUIRE(discs.size() == 1);
  CHECK((discs[0].center - Point(11, 2, 3)).norm() < 1e-6);
  CHECK(std::fabs(dot(discs[0].normal, Point(0, 0.6, 0.8))) == Approx(1));
  CHECK(discs[0].width == Approx(0.05));
}

TEST_CASE("discs are turned to the side from which they are seen, and those that are hidden are left out") {
  // A table top, 3 cm thick: seen from above, its lower side from a knee below; the floor under it from the side.
  Gaussians gaussians;
  add_sheet(gaussians, {-0.5, -0.5, 0.7}, {1, 0, 0}, {0, 1, 0}, 0.03);
  add_sheet(gaussians, {-0.5, -0.5, 0.67}, {1, 0, 0}, {0, 1, 0}, 0.03);
  const Index top = gaussians.count() / 2;
  const Point camera(0.3, -2, 1.5), knee(0.1, -0.1, 0.45);
  const auto turned_up = [](const std::vector<SurfaceDisc>& discs, double z) {
    Index up = 0, down = 0;
    for (const SurfaceDisc& disc : discs) {
      if (std::fabs(disc.center[2] - z) < 1e-3) (disc.normal[2] > 0 ? up : down) += 1;
    }
    return std::pair(up, down);
  };
  const std::vector<SurfaceDisc> discs = surface_discs(gaussians);
  const std::vector<SurfaceDisc> from_above = facing(discs, {camera}), both = facing(discs, {camera, knee});
  CHECK(turned_up(from_above, 0.7) == std::pair(top, Index{0}));
  CHECK(turned_up(from_above, 0.67).first < top / 20);  // some at the border are seen past the top
  CHECK(turned_up(both, 0.7) == std::pair(top, Index{0}));
  CHECK(turned_up(both, 0.67).second > top * 19 / 20);
  CHECK(facing(discs, {}).empty());
}

TEST_CASE("what stands between a surface and the viewpoint hides it") {
  Gaussians gaussians;
  add_sheet(gaussians, {-0.3, 1, 0}, {0.6, 0, 0}, {0, 0, 0.6}, 0.04);  // behind
  const Index behind = gaussians.count();
  add_sheet(gaussians, {-1, 0, -1}, {2, 0, 0}, {0, 0, 2}, 0.04);  // a wall
  const std::vector<SurfaceDisc> seen = facing(surface_discs(gaussians), {Point(0, -2, 0.3)});
  CHECK(static_cast<Index>(seen.size()) == gaussians.count() - behind);
  for (const SurfaceDisc& disc : seen) CHECK(disc.normal[1] < 0);
}

TEST_CASE("the distance to a floor of discs is the height, to its thickness, and unknown deeper and beside it") {
  Gaussians gaussians;
  add_sheet(gaussians, {-1, -1, 0}, {2, 0, 0}, {0, 2, 0}, 0.04);
  const GaussianDistance distance(facing(surface_discs(gaussians), {Point(0, 0, 1.5)}), 0.1);
  RandomSequence random(3);
  for (int i = 0; i < 300; ++i) {
    const Point p(random.uniform(-0.95, 0.95), random.uniform(-0.95, 0.95), random.uniform(-0.3, 0.5));
    if (p[2] < -0.1) {
      CHECK(std::isnan(distance.at(p)));
    } else {
      CHECK(distance.at(p) == Approx(p[2]).margin(1e-6));
    }
  }
  CHECK(std::isnan(distance.at({1.5, 0, -0.05})));
  CHECK(distance.at({30, 0, 0.2}) == Approx(0.2).margin(1e-6));
}

TEST_CASE("within a thin slab that is seen from both sides the nearer one counts, and below it all is free") {
  Gaussians gaussians;
  add_sheet(gaussians, {-0.5, -0.5, 0.7}, {1, 0, 0}, {0, 1, 0}, 0.03);
  add_sheet(gaussians, {-0.5, -0.5, 0.67}, {1, 0, 0}, {0, 1, 0}, 0.03);
  const GaussianDistance distance(facing(surface_discs(gaussians), {Point(0.3, -2, 1.5), Point(0.1, -0.1, 0.45)}), 0.1);
  CHECK(distance.at({0.1, 0.1, 0.75}) == Approx(0.05).margin(1e-3));
  CHECK(distance.at({0.1, 0.1, 0.69}) == Approx(-0.01).margin(1e-3));
  CHECK(distance.at({0.1, 0.1, 0.68}) == Approx(-0.01).margin(1e-3));
  CHECK(distance.at({0.1, 0.1, 0.63}) == Approx(0.04).margin(1e-3));
}

TEST_CASE("noise of the discs is averaged") {
  Gaussians gaussians;
  add_sheet(gaussians, {-1, -1, 0}, {2, 0, 0}, {0, 2, 0}, 0.04);
  RandomSequence random(4);
  for (Index g = 0; g < gaussians.count(); ++g)
    gaussians.means[static_cast<std::size_t>(3 * g + 2)] += static_cast<float>(random.uniform(-0.005, 0.005));
  const GaussianDistance distance(facing(surface_discs(gaussians), {Point(0, 0, 1.5)}), 0.1);
  double squares = 0;
  for (int i = 0; i < 500; ++i) {
    const Point p(random.uniform(-0.9, 0.9), random.uniform(-0.9, 0.9), random.uniform(-0.03, 0.03));
    const double error = distance.at(p) - p[2];
    squares += error * error / 500;
  }
  CHECK(std::sqrt(squares) < 0.002);  // of one disc 0.0029
}
