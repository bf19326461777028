#include "core/camera.h"

#include <numbers>
#include <vector>

#include "core/check.h"
#include "tests/core/adjoint_check.h"

namespace camera_test {

using namespace hsi4d;
using namespace hsi4d::testing;

namespace {

Camera test_camera() {
  Camera camera;
  camera.width = 640;
  camera.height = 480;
  camera.fx = 500;
  camera.fy = 510;
  camera.cx = 321;
  camera.cy = 238.5;
  camera.camera_from_world = look_at({3, -4, 2}, {0, 0, 1});
  return camera;
}

Vector2<double> project_world(const Camera& camera, const Vector3<double>& point_world) {
  return project_point(camera, transform_point(camera.camera_from_world, point_world));
}

}  // namespace

TEST_CASE("a camera that makes no sense is refused by name, value and what is allowed") {
  CHECK_NOTHROW(check_camera(test_camera()));
  const auto message = [](const auto& change) {
    Camera camera = test_camera();
    change(camera);
    try {
      check_camera(camera, "cam.json");
    } catch (const UserError& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  const double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();
  CHECK(message([](Camera& c) { c.width = 0; }) == "cam.json: width is 0; allowed: a whole number > 0");
  CHECK(message([](Camera& c) { c.height = -3; }) == "cam.json: height is -3; allowed: a whole number > 0");
  CHECK(message([](Camera& c) { c.fx = -1.5; }) == "cam.json: fx is -1.5; allowed: a finite number > 0");
  CHECK(message([&](Camera& c) { c.fy = nan; }) == "cam.json: fy is nan; allowed: a finite number > 0");
  CHECK(message([&](Camera& c) { c.cx = infinity; }) == "cam.json: cx is inf; allowed: a finite number");
  CHECK(message([&](Camera& c) { c.cy = nan; }) == "cam.json: cy is nan; allowed: a finite number");
  CHECK(message([&](Camera& c) { c.camera_from_world.rotation(1, 2) = nan; }) ==
        "cam.json: rotation[1][2] is nan; allowed: a finite number");
  CHECK(message([&](Camera& c) { c.camera_from_world.translation[2] = -infinity; }) ==
        "cam.json: translation[2] is -inf; allowed: a finite number");
  CHECK(message([](Camera& c) { c.camera_from_world.rotation = 2 * Matrix3<double>::Identity(); }) ==
        "cam.json: the rotation R is not orthonormal: |R R^T - I| is 3; allowed: at most 1e-04");
  CHECK(message([](Camera& c) { c.camera_from_world.rotation.row(1) *= -1; }) ==
        "cam.json: the rotation R mirrors: its determinant is -1; allowed: 1. An odd number of axes is turned round: "
        "those of a camera are OpenCV's, x right, y down, z forward, and from OpenGL's, y up, z backward, two differ; "
        "a world of left-handed axes must be made right-handed first");
  CHECK(message([](Camera& c) { c.camera_from_world.rotation.bottomRows<2>() *= -1; }) == "accepted");
  CHECK(message([](Camera& c) { c.camera_from_world.rotation *= 1.00004; }) == "accepted");
  CHECK(message([](Camera& c) { c.camera_from_world.rotation *= 1.00006; }) != "accepted");
}

TEST_CASE("a 4x4 matrix gives the transform, its last row is checked") {
  const Rigid<double> pose = test_camera().camera_from_world;
  Matrix4<double> matrix = matrix_from_rigid(pose);
  const Rigid<double> back = rigid_from_matrix(matrix);
  CHECK(back.rotation == pose.rotation);
  CHECK(back.translation == pose.translation);
  matrix(3, 2) = 0.5;
  CHECK_THROWS_WITH(rigid_from_matrix(matrix, "cam.json"), "cam.json: the last row is 0 0 0.5 1; allowed: 0 0 0 1");
  matrix(0, 3) = std::numeric_limits<double>::infinity();
  CHECK_THROWS_AS(rigid_from_matrix(matrix), UserError);
  CHECK_THROWS_WITH(rigid_from_matrix(matrix), "world_to_camera: matrix[0][3] is inf; allowed: a finite number");
}

TEST_CASE("the camera's centre is the point that its pose takes to zero, whatever the rotation is off by") {
  Camera camera = test_camera();
  camera.camera_from_world = look_at({600, -800, 20}, {0, 1, 2});
  camera.camera_from_world.rotation(0, 1) += 5e-5;
  camera.camera_from_world.rotation(2, 2) -= 2e-5;
  check_camera(camera);
  const Vector3<double> center = camera_center_world(camera);
  CHECK(transform_point(camera.camera_from_world, center).norm() < 1e-10);
  CHECK((center - Vector3<double>(600, -800, 20)).norm() > 1e-3);
  const Vector3<double> world(1, 2, 3);
  CHECK((point_in_view(view_of<double>(camera), world) - transform_point(camera.camera_from_world, world)).norm() <
        1e-10);
}

TEST_CASE("look_at: z forward, x right, y down in a z-up world") {
  const Rigid<double> pose = look_at({1, 2, 3}, {1, 12, 3});
  CHECK((transform_point(pose, Vector3<double>(1, 12, 3)) - Vector3<double>(0, 0, 10)).norm() < 1e-14);
  CHECK((pose.rotation * Vector3<double>(1, 0, 0) - Vector3<double>(1, 0, 0)).norm() < 1e-15);   // right
  CHECK((pose.rotation * Vector3<double>(0, 0, 1) - Vector3<double>(0, -1, 0)).norm() < 1e-15);  // up is −y
  Camera camera = test_camera();
  CHECK((camera_center_world(camera) - Vector3<double>(3, -4, 2)).norm() < 1e-14);
  CHECK((project_world(camera, {0, 0, 1}) - Vector2<double>(321, 238.5)).norm() < 1e-12);
  CHECK(project_world(camera, {0, 0, 1.5})[1] < 238.5);  // higher in the world is higher in the image
}

TEST_CASE("C13: look_at near and at the view parallel to up") {
  const double eps32 = std::numeric_limits<float>::epsilon();
  const Vector3<double> eye(0.3, -0.2, 0.7);
  RandomSequence random(60);
  for (int axis = 0; axis < 6; ++axis) {
    const Vector3<double> direction = Vector3<double>::Unit(axis / 2) * (axis % 2 == 0 ? 1 : -1);
    for (int up = 0; up < 3; ++up) {
      for (const double perturbation : {0.0, 1e-9, 1e-7, 1e-5, 1e-3}) {
        const Vector3<double> target = eye + direction + perturbation * random_column<3>(random);
        const Rigid<double> pose = look_at(eye, target, Vector3<double>::Unit(up));
        CHECK((pose.rotation * pose.rotation.transpose() - Matrix3<double>::Identity()).cwiseAbs().maxCoeff() <=
              4 * eps32);
        CHECK(dot(Vector3<double>(pose.rotation.row(0)),
                  cross(Vector3<double>(pose.rotation.row(1)), Vector3<double>(pose.rotation.row(2)))) ==
              Approx(1).epsilon(1e-12));
        CHECK((pose.rotation * (target - eye).normalized() - Vector3<double>::UnitZ()).norm() < 1e-12);
        CHECK(transform_point(pose, eye).norm() < 1e-12);
      }
    }
  }
  // Away from the degeneracy the pose moves as little as the target does.
  Rigid<double> before = look_at(eye, eye + Vector3<double>(1, 0, 0));
  for (double angle = 0; angle < 1.3; angle += 1e-4) {
    const Vector3<double> direction(std::cos(angle), 0.1 * std::sin(5 * angle), std::sin(angle));
    const Rigid<double> pose = look_at(eye, eye + direction);
    CHECK((pose.rotation - before.rotation).cwiseAbs().maxCoeff() <= 1e-3);
    before = pose;
  }
}

TEST_CASE("look_at refuses what has no direction, with the reason") {
  CHECK_THROWS_AS(look_at({1, 2, 3}, {1, 2, 3}), UserError);
  CHECK_THROWS_WITH(look_at({1, 2.5, 3}, {1, 2.5, 3}),
                    "look_at: eye and target are both (1, 2.5, 3); allowed: two different points");
  CHECK_THROWS_WITH(look_at({1, 2, 3}, {0, 0, 0}, {0, 0, 0}),
                    "look_at: up is (0, 0, 0); allowed: a direction that is not zero");
  CHECK_THROWS_WITH(look_at({1, std::numeric_limits<double>::infinity(), 3}, {0, 0, 0}),
                    "look_at: eye[1] is inf; allowed: a finite number");
  CHECK_NOTHROW(look_at({0, 0, 0}, {1e-300, 0, 0}));
  CHECK_NOTHROW(look_at({-1e308, 0, 0}, {1e308, 0, 0}));
}

TEST_CASE("projection and unprojection are inverses, their adjoints their derivatives") {
  const Camera camera = test_camera();
  RandomSequence random(61);
  for (int repeat = 0; repeat < 20; ++repeat) {
    const Vector3<double> p(random.uniform(-2, 2), random.uniform(-2, 2), random.uniform(0.5, 8));
    const Vector2<double> pixel = project_point(camera, p);
    CHECK((unproject_pixel(camera, pixel, p[2]) - p).norm() < 1e-14);
    CHECK(pixel[0] == Approx(500 * p[0] / p[2] + 321).epsilon(1e-15));
    check_adjoint<2>([&](const auto& x) { return project_point(camera, x); },
                     [&](const auto& x, const auto& g, auto& d) { project_point_adjoint(camera, x, g, d); }, p, random);
    check_adjoint<3>(
        [&]<class S>(const Vector3<S>& x) { return unproject_pixel(camera, Vector2<S>(x[0], x[1]), x[2]); },
        [&](const Vector3<double>& x, const Vector3<double>& g, Vector3<double>& d) {
          Vector2<double> d_pixel = d.head<2>();
          unproject_pixel_adjoint(camera, Vector2<double>(x[0], x[1]), x[2], g, d_pixel, d[2]);
          d.head<2>() = d_pixel;
        },
        Vector3<double>(pixel[0], pixel[1], p[2]), random);
    const Vector3<float> narrow_p = narrow(p);
    CHECK((widen(project_point(camera, narrow_p)) - project_point(camera, widen(narrow_p))).norm() < 2e-4);
  }
}

TEST_CASE("the camera's six numbers: chain through projection equals differences of updated cameras") {
  const Camera camera = test_camera();
  RandomSequence random(62);
  for (int repeat = 0; repeat < 10; ++repeat) {
    const Vector3<double> point_world = random_column<3>(random) * 0.3;
    const Vector2<double> g = random_column<2>(random);
    const View<double> view = view_of<double>(camera);
    const Vector3<double> point_camera = point_in_view(view, point_world);
    Vector3<double> d_camera = Vector3<double>::Zero(), d_world = Vector3<double>::Zero();
    project_point_adjoint(camera, point_camera, g, d_camera);
    Vector6<double> d_xi = Vector6<double>::Zero();
    se3_transform_point_adjoint_at_zero(point_camera, d_camera, d_xi);
    point_in_view_adjoint(view, d_camera, d_world);
    const auto image = [&](const Vector6<double>& xi) {
      Camera moved = camera;
      moved.camera_from_world = se3_update(xi, camera.camera_from_world);
      return project_world(moved, point_world);
    };
    const Vector6<double> expected = central_gradient<6>(image, Vector6<double>(Vector6<double>::Zero()), g);
    CHECK((d_xi - expected).norm() <= 1e-5 * expected.norm());
    const auto moved = [&](const Vector3<double>& p) { return project_world(camera, p); };
    const Vector3<double> expected_world = central_gradient<3>(moved, point_world, g);
    CHECK((d_world - expected_world).norm() <= 1e-6 * expected_world.norm());
  }
}

TEST_CASE("A10, M7: the camera-relative transform keeps its pixel at any distance from the origin") {
  RandomSequence random(63);
  for (const double offset : {0.0, 1e2, 1e3, 1e4, 1e6}) {
    double worst = 0, worst_naive = 0;
    for (int repeat = 0; repeat < 200; ++repeat) {
      // Multiples of 1/16 m: exact in float even at 10⁶ m, so that only the arithmetic is measured.
      const auto grid = [&](double from, double to) { return std::round(random.uniform(from, to) * 16) / 16; };
      const Vector3<double> shift(offset, -offset, offset);
      const Vector3<double> eye = Vector3<double>(grid(-2, 2), grid(-6, -4), grid(0, 2)) + shift;
      const Vector3<double> point = Vector3<double>(grid(-1, 1), grid(-1, 1), grid(0, 2)) + shift;
      Camera camera = test_camera();
      camera.fx = camera.fy = 1000;
      camera.camera_from_world = look_at(eye, shift);
      const Vector2<double> exact =
          project_point(camera, Vector3<double>(camera.camera_from_world.rotation * (point - eye)));
      const Vector3<float> stored = narrow(point);
      const Vector3<float> relative = point_in_view(view_of<float>(camera), stored);
      worst = std::fmax(worst, (widen(project_point(camera, relative)) - exact).norm());
      const Rigid<float> pose{narrow(camera.camera_from_world.rotation), narrow(camera.camera_from_world.translation)};
      const Vector2<float> naive = project_point(camera, transform_point(pose, stored));
      worst_naive = std::fmax(worst_naive, (widen(naive) - exact).norm());
    }
    CAPTURE(offset, worst, worst_naive);
    CHECK(worst <= 2e-4);
    if (offset >= 1e4) CHECK(worst_naive > 0.2);  // what R p + t does
  }
  // With an origin of its own, a scene far away is the scene at home.
  Camera far = test_camera();
  const Vector3<double> origin(1e6, 2e6, 3e5);
  far.camera_from_world = look_at(origin + Vector3<double>(3, -4, 2), origin + Vector3<double>(0, 0, 1));
  const Vector3<float> p(0.1f, 0.2f, 0.3f);
  const Vector3<float> home = point_in_view(view_of<float>(test_camera()), p);
  CHECK((point_in_view(view_of<float>(far, origin), p) - home).norm() < 1e-6f);
}

TEST_CASE("B20: pixel centres are at +0.5: a mirrored scene in a mirrored camera gives the mirrored position") {
  Camera camera = test_camera();
  Camera mirrored = camera;
  mirrored.cx = camera.width - camera.cx;
  const Vector3<double> p(0.3, -0.2, 2.5), q(-0.3, -0.2, 2.5);
  CHECK(project_point(mirrored, q)[0] == Approx(camera.width - project_point(camera, p)[0]).epsilon(1e-15));
  // The centre of the last column, column − 1 + 0.5, goes to that of the first.
  const Vector3<double> last = unproject_pixel(camera, Vector2<double>(camera.width - 0.5, 10.5), 2.0);
  CHECK(project_point(mirrored, Vector3<double>(-last[0], last[1], last[2]))[0] == Approx(0.5));
}

TEST_CASE("cropped and resized cameras see the same rays") {
  const Camera camera = test_camera();
  const Vector3<double> p(0.3, -0.2, 2.5);
  const Vector2<double> pixel = project_point(camera, p);
  const Camera crop = cropped(camera, 100, -20, 300, 200);
  CHECK((project_point(crop, p) - (pixel - Vector2<double>(100, -20))).norm() < 1e-12);
  CHECK(crop.width == 300);
  CHECK(crop.height == 200);
  const Camera half = resized(camera, 320, 120);
  CHECK(project_point(half, p)[0] == Approx(pixel[0] / 2).epsilon(1e-14));
  CHECK(project_point(half, p)[1] == Approx(pixel[1] / 4).epsilon(1e-14));
  CHECK(half.camera_from_world.rotation == camera.camera_from_world.rotation);
  CHECK_THROWS_WITH(cropped(camera, 0, 0, 0, 5), "crop: width is 0; allowed: a whole number > 0");
  CHECK_THROWS_WITH(resized(camera, 5, -1), "resize: height is -1; allowed: a whole number > 0");
  CHECK_THROWS_WITH(resized(Camera(), 5, 5), "resize: camera: width is 0; allowed: a whole number > 0");
}

}  // namespace camera_test
