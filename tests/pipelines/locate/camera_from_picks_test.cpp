#include "pipelines/locate/camera_from_picks.h"

#include <algorithm>
#include <cmath>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/parallel.h"
#include "core/random.h"
#include "optim/metrics.h"

namespace camera_from_picks_test {

using namespace hsi4d;

namespace {

/// What a random scene's points and their picks are like.
struct Making {
  Index count = 12;
  double noise_px = 0;
  double wrong = 0;    ///< share of picks that are anywhere in the picture
  bool flat = false;   ///< all on the ground
  double focal = 1.1;  ///< of the width
};

struct Made {
  Camera camera;
  std::vector<PickedPoint> picks;
  std::vector<bool> is_wrong;
};

/// Points in a room of 4 m, seen by a camera in it. The projection is written out here.
Made made(const Making& making, std::uint64_t seed) {
  const Random random(seed);
  Made result;
  Camera& camera = result.camera;
  camera = {640, 480, making.focal * 640, making.focal * 640, 320, 240, {}};
  const double around = random.uniform(0, 0, 6.28);
  const Vector3<double> eye(4 * std::cos(around), 4 * std::sin(around), random.uniform(1, 1.2, 2.5));
  const Vector3<double> target(random.uniform(2, -0.4, 0.4), random.uniform(3, -0.4, 0.4), random.uniform(4, 0.2, 0.8));
  camera.camera_from_world = look_at(eye, target);
  const Matrix3<double>& r = camera.camera_from_world.rotation;
  for (std::uint64_t k = 10; std::ssize(result.picks) < making.count; k += 10) {
    const Vector3<double> point(random.uniform(k, -1.5, 1.5), random.uniform(k + 1, -1.5, 1.5),
                                making.flat ? 0 : random.uniform(k + 2, 0, 2));
    const double x = r.row(0).dot(point - eye), y = r.row(1).dot(point - eye), z = r.row(2).dot(point - eye);
    Vector2<double> pixel(camera.fx * x / z + 320, camera.fy * y / z + 240);
    if (z < 0.5 || pixel[0] < 0 || pixel[0] >= 640 || pixel[1] < 0 || pixel[1] >= 480) continue;
    const bool is_wrong = static_cast<double>(result.picks.size()) < making.wrong * static_cast<double>(making.count);
    const auto [du, dv] = random.normal_pair(k + 3);
    pixel += making.noise_px * Vector2<double>(du, dv);
    if (is_wrong) pixel = {random.uniform(k + 4, 0, 640), random.uniform(k + 5, 0, 480)};
    result.picks.push_back({pixel, point});
    result.is_wrong.push_back(is_wrong);
  }
  return result;
}

PickedCamera found_of(const Made& made, bool has_focal, double tolerance = 6) {
  Camera intrinsics = made.camera;
  intrinsics.camera_from_world = {};
  if (!has_focal) intrinsics.fx = intrinsics.fy = 1;
  return camera_from_picks(made.picks, intrinsics, has_focal, tolerance, "picks.csv");
}

PoseError error_of(const PickedCamera& found, const Made& made) {
  return camera_error(found.camera.camera_from_world, made.camera.camera_from_world);
}

}  // namespace

TEST_CASE("three rays and three points have the true pose among theirs") {
  for (std::uint64_t seed = 0; seed < 300; ++seed) {
    CAPTURE(seed);
    const Made scene = made({.count = 3}, seed);
    std::array<Vector3<double>, 3> rays, points;
    for (std::size_t i = 0; i < 3; ++i) {
      points[i] = scene.picks[i].point_world;
      rays[i] = (scene.camera.camera_from_world.rotation * points[i] + scene.camera.camera_from_world.translation)
                    .normalized();
    }
    const std::vector<Rigid<double>> poses = poses_of_three(rays, points);
    CHECK(poses.size() <= 8);
    double nearest = 1e9;
    for (const Rigid<double>& pose : poses)
      nearest = std::min(nearest, camera_error(pose, scene.camera.camera_from_world).translation_cm);
    CHECK(nearest < 0.5);  // two roots that nearly meet are less exact; least squares follows
  }
  CHECK(poses_of_three({Vector3<double>(0, 0, 1), Vector3<double>(0.1, 0, 1).normalized(),
                        Vector3<double>(0.2, 0, 1).normalized()},
                       {Vector3<double>(0, 0, 3), Vector3<double>(0.3, 0, 3), Vector3<double>(0.6, 0, 3)})
            .empty());
}

TEST_CASE("exact picks give the camera, four of them with a focal length, six without") {
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    CAPTURE(seed);
    const Made few = made({.count = 5}, seed);
    CHECK(error_of(found_of(few, true), few).translation_cm < 1e-4);
    CHECK(error_of(found_of(few, true), few).rotation_deg < 1e-4);
    const Made more = made({.count = 9, .focal = 0.5 + 0.05 * static_cast<double>(seed)}, seed);
    const PickedCamera found = found_of(more, false);
    CHECK(found.camera.fx == Approx(more.camera.fx).epsilon(1e-5));
    CHECK(found.camera.fy == Approx(found.camera.fx));
    CHECK(error_of(found, more).translation_cm < 1e-2);
    CHECK(found.agreeing == 9);
  }
}

TEST_CASE("points of one plane give the camera where the focal length is known") {
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    CAPTURE(seed);
    const Made scene = made({.count = 8, .flat = true}, seed);
    CHECK(error_of(found_of(scene, true), scene).translation_cm < 1e-3);
  }
}

TEST_CASE("picks that are 2 pixels off, 30 % of them wrong, give a camera that is as near as they allow") {
  Index near = 0, told = 0;
  constexpr Index kScenes = 60;
  for (std::uint64_t seed = 0; seed < kScenes; ++seed) {
    CAPTURE(seed);
    const Made scene = made({.count = 20, .noise_px = 2, .wrong = 0.3}, seed);
    const PickedCamera found = found_of(scene, true);
    const PoseError error = error_of(found, scene);
    CHECK(error.translation_cm < 8);
    CHECK(error.rotation_deg < 1);
    near += error.translation_cm < 300 * found.position_m ? 1 : 0;  // within three standard deviations
    for (std::size_t i = 0; i < scene.picks.size(); ++i)
      told += scene.is_wrong[i] && !(found.errors_px[i] <= found.tolerance_px) ? 1 : 0;
  }
  CHECK(near >= kScenes - 3);
  CHECK(told >= 6 * kScenes - 6);  // now and then a wrong pick is right by chance
}

TEST_CASE("of eight picks two may be wrong") {
  Index near = 0;
  constexpr Index kScenes = 40;
  for (std::uint64_t seed = 100; seed < 100 + kScenes; ++seed) {
    CAPTURE(seed);
    const Made scene = made({.count = 8, .noise_px = 2, .wrong = 0.25}, seed);
    near += error_of(found_of(scene, true), scene).translation_cm < 20 ? 1 : 0;
  }
  CAPTURE(near);
  CHECK(near >= kScenes - 4);  // six picks may be met by chance
}

TEST_CASE("least squares is at a minimum: the gradient of the squared errors is zero") {
  const Made scene = made({.count = 15, .noise_px = 1.5}, 5);
  const PickedCamera found = found_of(scene, true, 20);
  REQUIRE(found.agreeing == 15);
  const auto cost = [&](const Camera& camera) {
    double sum = 0;
    for (const PickedPoint& pick : scene.picks)
      sum += (project_point(camera, transform_point(camera.camera_from_world, pick.point_world)) - pick.pixel)
                 .squaredNorm();
    return sum;
  };
  for (Index i = 0; i < 6; ++i) {
    Camera up = found.camera, down = found.camera;
    const Vector6<double> step = 1e-5 * Vector6<double>::Unit(i);
    up.camera_from_world = se3_update(step, found.camera.camera_from_world);
    down.camera_from_world = se3_update(Vector6<double>(-step), found.camera.camera_from_world);
    CHECK(cost(up) >= cost(found.camera));
    CHECK(cost(down) >= cost(found.camera));
    CHECK((cost(up) - cost(down)) / 2e-5 == Approx(0).margin(0.05));
  }
  CHECK(found.rms_px == Approx(std::sqrt(cost(found.camera) / 15)));
}

TEST_CASE("picks that tell no camera are refused in words") {
  const Made scene = made({.count = 20}, 1);
  const Camera camera = scene.camera;
  const auto error = [&](std::vector<PickedPoint> picks, bool has_focal) -> std::string {
    try {
      camera_from_picks(picks, camera, has_focal, 5, "picks.csv");
    } catch (const UserError& refused) {
      return refused.what();
    }
    return "";
  };
  const auto first = [&](Index count) {
    return std::vector<PickedPoint>(scene.picks.begin(), scene.picks.begin() + count);
  };
  CHECK(error(first(3), true) == "picks.csv: holds 3 picks; allowed: 4 or more");
  CHECK(error(first(5), false) ==
        "picks.csv: holds 5 picks; allowed: 4 or more with a focal length, 6 or more without");
  CHECK(error(first(4), true).empty());

  std::vector<PickedPoint> line;
  for (int i = 0; i < 8; ++i) {
    const Vector3<double> point(0.2 * i - 0.7, 0.1 * i, 0.5);
    line.push_back({project_point(camera, transform_point(camera.camera_from_world, point)), point});
  }
  CHECK_THAT(error(line, true), Catch::Contains("the points of the 8 picks lie on one line"));

  std::vector<PickedPoint> wrong = first(8);
  for (std::size_t i = 0; i < wrong.size(); ++i)
    wrong[i].pixel = {50 + 400 * static_cast<double>(i % 2), 60 * static_cast<double>(i)};
  CHECK_THAT(error(wrong, true), Catch::Contains("no camera shows 4 of the 8 picks within 5 pixels"));

  Camera above{640, 480, 700, 700, 320, 240, look_at({0, 0, 4}, {0, 0, 0})};  // looks straight down at the ground
  std::vector<PickedPoint> ground;
  for (int i = 0; i < 9; ++i) {
    const Vector3<double> point(0.5 * (i % 3) - 0.5, 0.5 * (i / 3) - 0.5, 0);
    ground.push_back({project_point(above, transform_point(above.camera_from_world, point)), point});
  }
  CHECK_THAT(error(ground, false), Catch::Contains("leave the focal length open"));
}

TEST_CASE("points behind the camera count as wrong picks") {
  Made scene = made({.count = 12}, 2);
  const Vector3<double> eye = camera_center_world(scene.camera);
  for (std::size_t i = 0; i < 3; ++i) scene.picks[i].point_world = 2 * eye - scene.picks[i].point_world;  // mirrored
  const PickedCamera found = found_of(scene, true);
  CHECK(error_of(found, scene).translation_cm < 1e-3);
  CHECK(found.agreeing == 9);
  CHECK(std::isinf(found.errors_px[0]));
}

TEST_CASE("the camera of many picks is the same on any number of threads and in each call", "[parallel]") {
  const Made scene = made({.count = 60, .noise_px = 2, .wrong = 0.3}, 3);  // more triples than are tried
  const PickedCamera once = found_of(scene, true);
  for (const int threads : {1, 3}) {
    with_threads(threads, [&] {
      const PickedCamera again = found_of(scene, true);
      CHECK(again.camera.camera_from_world.rotation == once.camera.camera_from_world.rotation);
      CHECK(again.camera.camera_from_world.translation == once.camera.camera_from_world.translation);
    });
  }
  CHECK(error_of(once, scene).translation_cm < 4);
}

}  // namespace camera_from_picks_test
