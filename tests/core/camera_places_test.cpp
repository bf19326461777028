#include "core/camera_places.h"

#include <catch2/catch.hpp>

namespace camera_places_test {

using namespace hsi4d;

TEST_CASE("cameras around a place see it in their middle, from all sides, and a ball of the radius whole") {
  const Vector3<double> center(1, -2, 3);
  const std::vector<Camera> cameras = cameras_around(center, 0.5, 60, 100, kAllSides);
  REQUIRE(cameras.size() == 60);
  Vector3<double> mean = Vector3<double>::Zero();
  for (const Camera& camera : cameras) {
    check_camera(camera);
    const Vector3<double> seen = transform_point(camera.camera_from_world, center);
    CHECK(project_point(camera, seen).isApprox(Vector2<double>(50, 50), 1e-9));
    CHECK(camera.fx * 0.5 / seen[2] < 50);
    CHECK(camera.fx * 0.5 / seen[2] > 15);
    mean += (camera_center_world(camera) - center).normalized() / 60.0;
  }
  CHECK(mean.norm() < 0.02);
  const auto lowest = [&](double limit) {
    double z = 1;
    for (const Camera& camera : cameras_around(center, 0.5, 60, 100, limit))
      z = std::min(z, (camera_center_world(camera) - center).normalized()[2]);
    return z;
  };
  CHECK(lowest(-1) < -0.97);
  CHECK(lowest(-0.6) > -0.6);
}

TEST_CASE("six cameras see every direction once") {
  const Vector3<double> eye(0.3, 0.2, 1);
  const std::vector<Camera> cameras = cameras_to_all_sides(eye, 32);
  REQUIRE(cameras.size() == 6);
  for (int n = 0; n < 500; ++n) {
    const double a = 0.7 * n, z = -0.99 + 1.98 * n / 499.0, r = std::sqrt(1 - z * z);
    const Vector3<double> way(r * std::cos(a), r * std::sin(a), z);
    int seen = 0;
    for (const Camera& camera : cameras) {
      const Vector3<double> p = transform_point(camera.camera_from_world, Vector3<double>(eye + way));
      const Vector2<double> pixel = p[2] > 0 ? project_point(camera, p) : Vector2<double>(-1, -1);
      seen += (pixel.array() >= 0).all() && (pixel.array() < 32).all() ? 1 : 0;
    }
    CHECK(seen == 1);
  }
}

}  // namespace camera_places_test
