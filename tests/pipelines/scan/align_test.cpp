#include "pipelines/scan/align.h"

#include <cmath>

#include <Eigen/Geometry>
#include <catch2/catch.hpp>

#include "core/camera_places.h"
#include "core/check.h"
#include "core/random.h"
#include "core/rotation.h"
#include "pipelines/synthetic/photos.h"
#include "pipelines/synthetic/scene.h"

namespace align_test {

using namespace hsi4d;

namespace {

/// A floor with a thickness of some millimetres, walls, boxes on it, and a few points below: in metres, z up.
/// @param floor_share  of all points
std::vector<Vector3<double>> room(double floor_share, std::uint64_t seed) {
  const Random random(seed);
  std::vector<Vector3<double>> points;
  constexpr std::size_t kCount = 6000;
  for (std::size_t i = 0; i < kCount; ++i) {
    const auto u = [&](std::uint64_t k) { return random.uniform(8 * i + k); };
    const double x = 6 * u(0) - 3, y = 5 * u(1) - 2.5;
    if (u(2) < floor_share) {
      points.push_back({x, y, 0.004 * random.normal(8 * i + 7)});
    } else if (u(2) < floor_share + 0.01) {
      points.push_back({x, y, -2 * u(3)});  // floaters
    } else if (u(4) < 0.4) {
      points.push_back({x, 2.5, 2.6 * u(3)});  // a wall
    } else if (u(4) < 0.7) {
      points.push_back({0.3 * x, 0.3 * y, 0.75 + 0.003 * u(3)});  // a table, denser than the floor
    } else {
      points.push_back({x, y, 2.6 * u(3)});
    }
  }
  return points;
}

Similarity random_similarity(std::uint64_t seed) {
  const Random random(seed, 1);
  Similarity similarity;
  similarity.scale = std::exp(random.uniform(0, -2, 2));
  const Vector4<double> q = random.rotation(1);
  similarity.rotation = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).toRotationMatrix();
  similarity.translation =
      Vector3<double>(random.uniform(2, -9, 9), random.uniform(3, -9, 9), random.uniform(4, -9, 9));
  return similarity;
}

double degrees_between(const Vector3<double>& a, const Vector3<double>& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) * 180 / std::acos(-1.0);
}

}  // namespace

TEST_CASE("a scene that was turned, moved and scaled is put back on its ground") {
  for (const double floor_share : {0.1, 0.3}) {
    for (std::uint64_t seed = 0; seed < 12; ++seed) {
      CAPTURE(floor_share, seed);
      const Similarity away = random_similarity(seed);
      std::vector<Vector3<double>> points;
      for (const Vector3<double>& point : room(floor_share, seed)) points.push_back(transform_point(away, point));
      const Vector3<double> tilted =
          away.rotation * so3_exp(Vector3<double>(0.2, -0.15, 0)) * Vector3<double>(0, 0, 1);  // 14 degrees off
      const GroundPlane ground = find_ground(points, tilted);
      CHECK(degrees_between(ground.up, away.rotation.col(2)) < 0.5);
      CHECK(ground.share > 0.8 * floor_share);
      // The scale by a head of 1.7 m at a place: it stood at z = 1.7 before.
      const Vector3<double> head = transform_point(away, Vector3<double>(1, -1, 1.7));
      const double scale = 1.7 / height_over(ground, head);
      CHECK(scale * away.scale == Approx(1).epsilon(0.01));
      const Similarity back = alignment(ground, scale, transform_point(away, Vector3<double>(0.5, 0.5, 1)));
      for (const Vector3<double>& place :
           {Vector3<double>(0, 0, 0), Vector3<double>(2, -2, 0), Vector3<double>(-2, 1, 0)})
        CHECK(std::abs(transform_point(back, transform_point(away, place))[2]) < 0.01);
      CHECK(std::abs(transform_point(back, transform_point(away, Vector3<double>(0.5, 0.5, 0)))[2]) < 0.01);
      CHECK(transform_point(back, transform_point(away, Vector3<double>(0.5, 0.5, 0))).head<2>().norm() < 0.02);
    }
  }
}

TEST_CASE("a camera that goes along sees the same") {
  const Similarity similarity = random_similarity(3);
  const Camera camera = cameras_around(Vector3<double>(1, 2, 3), 1, 5, 64, kMostSides)[3];
  const Camera moved = moved_camera(camera, similarity);
  for (const Vector3<double>& point : {Vector3<double>(1, 2, 3), Vector3<double>(1.3, 1.8, 2.5)}) {
    const Vector3<double> before = transform_point(camera.camera_from_world, point);
    const Vector3<double> after = transform_point(moved.camera_from_world, transform_point(similarity, point));
    CHECK(project_point(moved, after).isApprox(project_point(camera, before), 1e-12));
    CHECK(after[2] == Approx(similarity.scale * before[2]).epsilon(1e-12));
  }
}

TEST_CASE("the ground of a made scene") {
  const Gaussians scene = synthetic_scene(SyntheticSceneKind::kLivingRoom, 12000, {}, 0);
  const std::vector<Camera> cameras = cameras_in_scene(30, 64, 0);
  const GroundPlane ground = find_ground(solid_points(scene), up_of(cameras));
  CHECK(degrees_between(ground.up, Vector3<double>(0, 0, 1)) < 0.5);
  CHECK(std::abs(ground.height) < 0.01);
}

TEST_CASE("a scene without a ground is refused in words") {
  const Random random(1);
  std::vector<Vector3<double>> ball;
  for (std::size_t i = 0; i < 4000; ++i) {
    const Vector3<double> way(random.normal(3 * i), random.normal(3 * i + 1), random.normal(3 * i + 2));
    ball.push_back(way.normalized() * std::cbrt(random.uniform(100000 + i)));
  }
  CHECK_THROWS_WITH(find_ground(ball, Vector3<double>(0, 0, 1)),
                    Catch::Matchers::Contains("no ground is found: of level"));
  CHECK_THROWS_WITH(find_ground(std::vector<Vector3<double>>(10, Vector3<double>::Zero()), Vector3<double>(0, 0, 1)),
                    Catch::Matchers::Contains("10 points are too few"));
  CHECK_THROWS_AS(find_ground(std::vector<Vector3<double>>(100, Vector3<double>::Zero()), Vector3<double>(0, 0, 1)),
                  UserError);  // all at one place
  Camera up, down;
  down.camera_from_world.rotation = Vector3<double>(-1, -1, 1).asDiagonal();
  CHECK_THROWS_WITH(up_of({up, down}), Catch::Matchers::Contains("cancel"));
}

}  // namespace align_test
