#include "core/lens.h"

#include <cmath>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/random.h"

namespace lens_test {

using namespace hsi4d;

namespace {

Camera usual_camera() {
  Camera camera;
  camera.width = 160;
  camera.height = 120;
  camera.fx = 130;
  camera.fy = 125;
  camera.cx = 82;
  camera.cy = 58.5;
  return camera;
}

/// Something smooth to take a picture of, by the direction at depth 1.
double brightness(double x, double y) { return 0.5 + 0.25 * std::sin(5 * x + 1) + 0.25 * std::cos(4 * y - 2 * x); }

/// The direction that a lens shows at a place: the inverse of bent_by, by fixed-point steps.
Vector2<double> straight(const Lens& lens, const Vector2<double>& bent) {
  Vector2<double> point = bent;
  for (int i = 0; i < 200; ++i) point += bent - bent_by(lens, point);
  return point;
}

}  // namespace

TEST_CASE("a lens bends as the formula says") {
  const Lens lens{.k1 = 0.1, .k2 = -0.05, .k3 = 0.02, .p1 = 0.003, .p2 = -0.004};
  const double x = 0.3, y = -0.7, r2 = x * x + y * y;
  const double s = 1 + 0.1 * r2 - 0.05 * r2 * r2 + 0.02 * r2 * r2 * r2;
  const Vector2<double> bent = bent_by(lens, {x, y});
  CHECK(bent[0] == Approx(x * s + 2 * 0.003 * x * y - 0.004 * (r2 + 2 * x * x)).epsilon(1e-14));
  CHECK(bent[1] == Approx(y * s + 0.003 * (r2 + 2 * y * y) - 2 * 0.004 * x * y).epsilon(1e-14));
  CHECK(bent_by({}, {x, y}) == Vector2<double>(x, y));
}

TEST_CASE("a picture through a lens becomes that of a pinhole") {
  const Camera camera = usual_camera();
  for (const Lens& lens : {Lens{}, Lens{.k1 = -0.2, .k2 = 0.05}, Lens{.k1 = 0.12, .p1 = 0.004, .p2 = -0.006}}) {
    Image taken(1, camera.height, camera.width);
    for (int row = 0; row < taken.height(); ++row) {
      for (int col = 0; col < taken.width(); ++col) {
        const Vector2<double> point =
            straight(lens, {(col + 0.5 - camera.cx) / camera.fx, (row + 0.5 - camera.cy) / camera.fy});
        taken(0, row, col) = static_cast<float>(brightness(point[0], point[1]));
      }
    }
    const StraightImage result = straightened(taken, camera, lens);
    int seen = 0;
    double worst = 0;
    for (int row = 0; row < taken.height(); ++row) {
      for (int col = 0; col < taken.width(); ++col) {
        if (result.seen(0, row, col) == 0) {
          CHECK(result.image(0, row, col) == 0);
          continue;
        }
        ++seen;
        const double x = (col + 0.5 - camera.cx) / camera.fx, y = (row + 0.5 - camera.cy) / camera.fy;
        worst = std::max(worst, std::abs(result.image(0, row, col) - brightness(x, y)));
      }
    }
    CHECK(worst < 2e-4);
    CHECK(seen > camera.width * camera.height * 3 / 4);
    if (lens.is_straight()) CHECK(result.image == taken);
    if (lens.k1 > 0) CHECK(seen < camera.width * camera.height);
  }
}

TEST_CASE("a place shows the direction that the lens bends to it") {
  RandomSequence random(8);
  for (int i = 0; i < 2000; ++i) {
    const Lens lens{random.uniform(-0.4, 0.4), random.uniform(-0.1, 0.1), random.uniform(-0.02, 0.02),
                    random.uniform(-0.01, 0.01), random.uniform(-0.01, 0.01)};
    const double reach = 0.9 * std::sqrt(std::min(1.5, valid_radius_squared(lens))), turn = random.uniform(0, 6.3);
    const double radius = random.uniform(0, reach);
    const Vector2<double> point(radius * std::cos(turn), radius * std::sin(turn)), bent = bent_by(lens, point);
    INFO("k1 " << lens.k1 << ", radius " << radius);
    CHECK((straight_of(lens, bent) - point).norm() < 1e-9);
    if (std::abs(lens.k1) < 0.15 && radius < 0.8) CHECK((straight_of(lens, bent) - straight(lens, bent)).norm() < 1e-9);
  }
  CHECK(straight_of({}, {0.3, -0.2}) == Vector2<double>(0.3, -0.2));
  CHECK(straight_of({.k1 = -0.4}, {5, 5}).allFinite());  // shown nowhere
}

TEST_CASE("beyond where a lens turns back nothing is seen") {
  const Lens folding{.k1 = -0.5};
  CHECK(valid_radius_squared(folding) == Approx(1 / 1.5).epsilon(2e-3));
  CHECK(std::isinf(valid_radius_squared({.k1 = 0.3})));
  Camera wide = usual_camera();
  wide.fx = wide.fy = 60;
  Image white(1, wide.height, wide.width);
  for (float& number : white.data()) number = 1;
  const StraightImage result = straightened(white, wide, folding);
  CHECK(result.seen(0, 0, 0) == 0);
  CHECK(result.seen(0, wide.height / 2, wide.width / 2) == 1);
  CHECK_THROWS_AS(straightened(Image(1, 3, 3), wide, folding), InternalError);
}

TEST_CASE("a lens that turns back within the picture covers no picture of that size") {
  Camera camera{200, 100, 100, 100, 100, 50, {}};  // edges at 1 and 0.5
  CHECK(covers_picture({}, camera));
  CHECK(covers_picture({.k1 = 9}, camera));
  // It turns back at 1/sqrt(-3 k1), which it shows at two thirds of that.
  CHECK(covers_picture({.k1 = -0.148}, camera));
  CHECK_FALSE(covers_picture({.k1 = -0.149}, camera));
  camera.cx = 105;
  CHECK_FALSE(covers_picture({.k1 = -0.148}, camera));
  CHECK(covers_picture({.k1 = -0.3, .k2 = 0.09}, camera));  // grows again
}

}  // namespace lens_test
