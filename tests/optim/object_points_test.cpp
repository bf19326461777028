#include "optim/object_points.h"

#include <algorithm>
#include <numbers>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/random.h"
#include "core/rotation.h"

namespace object_points_test {

using namespace hsi4d;

namespace {

using Point = Vector3<double>;

Gaussians points_object(const std::vector<Point>& points) {
  Gaussians object;
  for (const Point& point : points) {
    for (int i = 0; i < 3; ++i) object.means.push_back(static_cast<float>(point[i]));
    object.opacity_logits.push_back(0);
  }
  return object;
}

}  // namespace

TEST_CASE("ADD and ADD-S have the values of a pencil and paper") {
  // A square, 2 m wide: a quarter turn moves each corner by its edge, and leaves the same set of points.
  const Gaussians square = points_object({{1, 1, 0}, {-1, 1, 0}, {-1, -1, 0}, {1, -1, 0}});
  const ObjectPoints points({&square});
  CHECK(points.objects() == 1);
  const Rigid<double> truth{so3_exp(Point(0, 0, 0.4)), {5, 6, 7}};
  const Rigid<double> turned{so3_exp(Point(0, 0, 0.4 + std::numbers::pi / 2)), {5, 6, 7}};
  const ObjectPointErrors turn = points.errors(0, turned, truth);
  CHECK(turn.add_cm == Approx(200));
  CHECK(turn.add_s_cm == Approx(0).margin(1e-5));
  const Rigid<double> moved{truth.rotation, {5, 6, 7.03}};
  CHECK(points.errors(0, moved, truth).add_cm == Approx(3));
  CHECK(points.errors(0, moved, truth).add_s_cm == Approx(3));
  CHECK(points.errors(0, truth, truth).add_cm == 0);
  CHECK_THROWS_AS(points.errors(1, truth, truth), InternalError);
}

TEST_CASE("ADD and ADD-S agree with plain loops over all pairs of points") {
  RandomSequence random(11);
  std::vector<Point> places;
  for (int i = 0; i < 300; ++i)
    places.emplace_back(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1));
  const Gaussians object = points_object(places);
  const ObjectPoints points({&object});
  const Rigid<double> truth{so3_exp(Point(0.3, -0.2, 1)), {0.1, 0.2, 0.3}};
  const Rigid<double> pose{so3_exp(Point(-0.1, 0.5, 0.7)), {0.2, -0.1, 0.3}};
  double add = 0, add_s = 0;
  const auto place = [&](const Rigid<double>& at, std::size_t i) {
    return transform_point(at, Point(Vector3<float>(object.means.data() + 3 * i).cast<double>()));
  };
  for (std::size_t i = 0; i < places.size(); ++i) {
    add += (place(pose, i) - place(truth, i)).norm();
    double least = 1e9;
    for (std::size_t k = 0; k < places.size(); ++k) least = std::min(least, (place(pose, k) - place(truth, i)).norm());
    add_s += least;
  }
  const ObjectPointErrors errors = points.errors(0, pose, truth);
  CHECK(errors.add_cm == Approx(100 * add / 300).epsilon(1e-9));
  CHECK(errors.add_s_cm == Approx(100 * add_s / 300).epsilon(1e-9));
  CHECK(errors.add_s_cm < errors.add_cm);
}

TEST_CASE("of many points some are looked at, and of none nothing is wrong") {
  std::vector<Point> places(5 * static_cast<std::size_t>(kMeasuredObjectPoints), Point(1, 2, 3));
  const Gaussians many = points_object(places), none;
  const ObjectPoints points({&many, &none});
  const Rigid<double> truth, moved{Matrix3<double>::Identity(), {0, 0.5, 0}};
  CHECK(points.errors(0, moved, truth).add_cm == Approx(50));
  CHECK(points.errors(1, moved, truth).add_cm == 0);
}

}  // namespace object_points_test
