#include "optim/solid/gaussian_surface.h"

#include <algorithm>
#include <cmath>

#include <catch2/catch.hpp>

#include "core/quaternion.h"
#include "core/random.h"
#include "tests/optim/solid/surface_of_test.h"

namespace gaussian_surface_test {

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
  CHECK(discs[0].narrow == Approx(0.05));
}

TEST_CASE("a disc that is longer than wide reaches as far as it is long and as wide") {
  Gaussians gaussians;
  add_disc(gaussians, {0, 0, 0}, {0, 0, 1}, 0.3);
  gaussians.log_scales[1] = std::log(0.02f);
  gaussians.log_scales[2] = std::log(0.004f);
  const std::vector<SurfaceDisc> discs = surface_discs(gaussians);
  REQUIRE(discs.size() == 1);
  CHECK(discs[0].width == Approx(0.3));
  CHECK(discs[0].narrow == Approx(0.02));
  const GaussianDistance distance(facing(discs, {Point(0, 0, 2)}), 0.1);
  const Point along = 0.5 * discs[0].along, across = 0.1 * cross(discs[0].normal, discs[0].along);
  const Point below(0, 0, -0.05);
  CHECK(distance.at(along + below) == Approx(-0.05).margin(1e-6));
  CHECK(std::isnan(distance.at(across + below)));
  // What is behind it is hidden along it, and seen past its side.
  for (const auto& [place, is_seen] : {std::pair<Point, bool>{along, false}, {across, true}}) {
    Gaussians both = gaussians;
    add_disc(both, 2 * place - Point(0, 0, 2), {0, 0, 1}, 0.05);
    CHECK(facing(surface_discs(both), {Point(0, 0, 2)}).size() == (is_seen ? 2 : 1));
  }
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

TEST_CASE("large discs hide what is behind all of them") {
  Gaussians gaussians;
  add_sheet(gaussians, {-0.3, 1, 0}, {0.6, 0, 0}, {0, 0, 0.6}, 0.04);  // behind
  const Index behind = gaussians.count();
  add_sheet(gaussians, {-2, 0, -2}, {4, 0, 0}, {0, 0, 4}, 0.8);  // a wall of 25
  CHECK(static_cast<Index>(facing(surface_discs(gaussians), {Point(0.1, -2, 0.3)}).size()) ==
        gaussians.count() - behind);
}

TEST_CASE("what is far away hides nothing near and is asked for in no more time") {
  Gaussians gaussians;
  add_sheet(gaussians, {-0.5, -0.5, 0}, {1, 0, 0}, {0, 1, 0}, 0.04);
  const auto near = static_cast<std::size_t>(gaussians.count());
  for (int i = 0; i < 200; ++i)  // a sky, whose rays would each pass 10⁹ of the smallest cells
    add_disc(gaussians, {1e8 * std::cos(0.03 * i), 1e8 * std::sin(0.03 * i), 5e7}, {0, 0, 1}, 5e5);
  const std::vector<SurfaceDisc> discs = surface_discs(gaussians), seen = facing(discs, {Point(0, 0, 1.5)});
  CHECK(seen.size() == near + 200);
  for (std::size_t i = 0; i < near; ++i) CHECK(seen[i].normal[2] > 0);
}

TEST_CASE("discs are turned to the side that most see, whatever the order, and left out where as many see either") {
  // Two discs at the same place, which do not hide each other.
  Gaussians gaussians;
  const Point normal = direction_of(Point(0.3, -0.5, 0.7)).unit;
  add_disc(gaussians, {0, 0, 0}, normal, 0.1);
  add_disc(gaussians, {0, 0, 0}, {1, 0, 0}, 0.1);
  const std::vector<SurfaceDisc> discs = surface_discs(gaussians);
  // From the first viewpoint the first disc is edge on; the second one is seen from −x by the second alone.
  std::vector<Point> places = {{2, 1.2, 0}, {-1, -2, 4}, {3, 0.1, 0.2}};
  for (int order = 0; order < 2; ++order) {
    const std::vector<SurfaceDisc> turned = facing_most(discs, places);
    REQUIRE(turned.size() == 2);
    CHECK(dot(turned[0].normal, normal) == Approx(1));
    CHECK(turned[1].normal[0] == Approx(1));
    std::reverse(places.begin(), places.end());
  }
  const std::vector<SurfaceDisc> one = facing_most(discs, {places[0], places[1]});
  REQUIRE(one.size() == 1);
  CHECK(dot(one[0].normal, normal) == Approx(1));
  // One by one: as often from the front as from behind.
  std::vector<SurfaceDisc> tilted = {discs[0]};
  tilted[0].normal *= 1 + 1e-7;  // as rounding leaves normals
  const Point front = 3 * normal;
  CHECK(facing_most(tilted, {front, front, front, -front, -front, -front}).empty());
  CHECK(facing_most(tilted, {front, -front, front}).size() == 1);
  CHECK(facing_most({}, {front}).empty());
}

TEST_CASE("a disc that floats alone is no surface") {
  Gaussians gaussians;
  add_sheet(gaussians, {-0.5, -0.5, 0}, {1, 0, 0}, {0, 1, 0}, 0.04);
  const auto sheet = static_cast<std::size_t>(gaussians.count());
  add_disc(gaussians, {0, 0, 1}, {0, 0, 1}, 0.05);    // in the air
  add_disc(gaussians, {0, 0, 300}, {0, 0, 1}, 0.05);  // far away
  const std::vector<SurfaceDisc> discs = surface_discs(gaussians), left = without_floaters(discs);
  REQUIRE(left.size() == sheet);
  for (const SurfaceDisc& disc : left) CHECK(disc.center[2] == 0);
  CHECK(without_floaters({}).empty());
}

TEST_CASE("fewer discs cover what all of them did") {
  Gaussians gaussians;
  add_sheet(gaussians, {-0.5, -0.5, 0}, {1, 0, 0}, {0, 1, 0}, 0.01);
  const std::vector<SurfaceDisc> all = facing(surface_discs(gaussians), {Point(0, 0, 1)});
  REQUIRE(all.size() == 10000);
  const std::vector<SurfaceDisc> few = thinned(all, 700);
  REQUIRE(few.size() == 700);
  CHECK(thinned(all, 10000).size() == 10000);
  CHECK(few[3].narrow == Approx(all[0].narrow * std::sqrt(10000.0 / 700)));
  const GaussianDistance distance(few, 0.1);
  RandomSequence random(6);
  int unknown = 0;
  for (int i = 0; i < 1000; ++i)
    unknown += std::isnan(distance.at({random.uniform(-0.45, 0.45), random.uniform(-0.45, 0.45), -0.05})) ? 1 : 0;
  CHECK(unknown < 20);
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

}  // namespace gaussian_surface_test
