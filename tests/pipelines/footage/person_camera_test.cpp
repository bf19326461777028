#include "pipelines/footage/person_camera.h"

#include <cmath>

#include <catch2/catch.hpp>

#include "body/kinematics.h"
#include "body/procedural_body.h"
#include "core/angles.h"
#include "core/check.h"
#include "core/random.h"
#include "pipelines/draw/standing.h"

namespace person_camera_test {

using namespace hsi4d;

namespace {

const Avatar& person() {
  static const Avatar avatar = surface_avatar(procedural_body(), {.gaussians = 2000});
  return avatar;
}

struct Scene {
  Camera camera;
  Keypoints keypoints;
  std::vector<Vector2<double>> places;
};

Camera camera_at(double height, double pitch_deg, double turn_deg = 90) {
  Camera camera{640, 480, 800, 800, 320, 240, {}};
  const Vector3<double> eye(0, 0, height);
  const double pitch = pitch_deg * kDegree, turn = turn_deg * kDegree;
  camera.camera_from_world = look_at(
      eye, eye + Vector3<double>(std::cos(pitch) * std::cos(turn), std::cos(pitch) * std::sin(turn), -std::sin(pitch)));
  return camera;
}

std::vector<Keypoint> seen_points(const Keypoints& keypoints, const Camera& camera, const BodyPose& pose,
                                  double noise_px, const Random& random) {
  const std::vector<double> joints = pose_joints(person().parents, person().joints, pose);
  std::vector<Keypoint> points;
  for (const KeypointJoints& point : keypoints.joints) {
    const Vector3<double> joint(joints.data() + 3 * point.front().first);
    const Vector3<double> at = camera.camera_from_world.rotation * joint + camera.camera_from_world.translation;
    const Vector2<double> pixel = project_point(camera, at);
    const std::uint64_t k = 2 * points.size();
    points.push_back({(pixel[0] + noise_px * random.normal(k)) / camera.width,
                      (pixel[1] + noise_px * random.normal(k + 1)) / camera.height, 0.9});
  }
  return points;
}

/// An upright person who comes nearer and turns.
/// @param bent  share of the frames in which the person bends down
Scene walking(double height, double pitch_deg, double noise_px, double bent, std::uint64_t seed) {
  Scene scene{camera_at(height, pitch_deg), {}, {}};
  for (int joint = 0; joint < kSmplxJoints; ++joint) scene.keypoints.joints.push_back({{joint, 1.0}});
  const Random random(seed);
  constexpr int kFrames = 30;
  for (int t = 0; t < kFrames; ++t) {
    const StandingPlace place{random.uniform(static_cast<std::uint64_t>(t), -1, 1), 7 - 0.12 * t, 12.0 * t, 0};
    BodyPose pose = standing_pose(person(), place);
    if (random.uniform(static_cast<std::uint64_t>(1000 + t)) < bent)
      pose.set_rotation(smplx_joint("spine1"), Vector3<double>(80 * kDegree, 0, 0));
    scene.keypoints.frames.push_back(
        seen_points(scene.keypoints, scene.camera, pose, noise_px, Random(seed, static_cast<std::uint64_t>(t) + 1)));
    scene.places.emplace_back(place.x, place.y);
  }
  return scene;
}

}  // namespace

TEST_CASE("how far somebody goes is not what one wrong frame says") {
  PersonCamera found;
  found.camera = camera_at(1.5, 0);
  CHECK(far_distance(found) == 0);
  for (int t = 0; t < 20; ++t) found.places.emplace_back(Vector2<double>(0, 3 + 0.1 * t));
  found.places[7] = Vector2<double>(0, 58);
  found.places.emplace_back();  // a frame without ankles
  CHECK(far_distance(found) == Approx(4.8));
}

TEST_CASE("a camera is found from somebody who walks") {
  for (const auto& [height, pitch] : {std::pair(0.6, -5.0), {1.5, 5.0}, {1.2, 0.0}, {2.6, 25.0}}) {
    const Scene scene = walking(height, pitch, 1, 0, 3);
    const PersonCamera found = camera_of_person(scene.keypoints, person(), scene.camera, {}, "points.json");
    CAPTURE(height, pitch, found.height, found.pitch_deg);
    CHECK(found.height == Approx(height).epsilon(0.08));
    CHECK(found.pitch_deg == Approx(pitch).margin(1.5));
    CHECK(found.agreeing > 0.95);
    for (std::size_t t = 0; t < scene.places.size(); ++t) {
      REQUIRE(found.places[t]);
      CHECK((*found.places[t] - scene.places[t]).norm() < 0.1 * scene.places[t].norm());
    }
  }
}

TEST_CASE("frames in which the person is not upright do not mislead") {
  const Scene scene = walking(1.4, 8, 1, 0.35, 5);
  const PersonCamera found = camera_of_person(scene.keypoints, person(), scene.camera, {}, "points.json");
  CHECK(found.height == Approx(1.4).epsilon(0.1));
  CHECK(found.pitch_deg == Approx(8).margin(2));
  CHECK(found.agreeing > 0.6);
  CHECK(found.agreeing < 0.95);
}

TEST_CASE("somebody who sits tells the camera too") {
  Scene scene = walking(1.3, 10, 0, 0, 15);
  for (std::size_t t = 0; t < scene.places.size(); ++t) {
    BodyPose pose = standing_pose(person(), {scene.places[t][0], scene.places[t][1], -90, 0});
    pose.transl[2] -= 0.4;
    for (const char* const side : {"left_", "right_"}) {  // thighs forward, shins down
      pose.set_rotation(smplx_joint(side + std::string("hip")), Vector3<double>(-85 * kDegree, 0, 0));
      pose.set_rotation(smplx_joint(side + std::string("knee")), Vector3<double>(85 * kDegree, 0, 0));
    }
    scene.keypoints.frames[t] = seen_points(scene.keypoints, scene.camera, pose, 1, Random(15, t));
  }
  const PersonCamera found = camera_of_person(scene.keypoints, person(), scene.camera, {}, "points.json");
  CAPTURE(found.height, found.pitch_deg, found.agreeing);
  CHECK(found.height == Approx(1.3).epsilon(0.25));
  CHECK(found.pitch_deg == Approx(10).margin(5));
  CHECK(found.agreeing > 0.5);
}

TEST_CASE("a known height is kept, and leaves the pitch alone to find") {
  Scene scene = walking(2.2, 15, 0, 0, 7);
  scene.keypoints.frames.resize(1);
  const PersonCamera found = camera_of_person(scene.keypoints, person(), scene.camera, 2.2, "points.json");
  CHECK(found.height == Approx(2.2));
  CHECK(found.pitch_deg == Approx(15).margin(0.5));
}

TEST_CASE("a known camera tells where the person is") {
  Scene scene = walking(1.7, 10, 0, 0, 9);
  const PersonCamera found = placed_person(scene.keypoints, person(), scene.camera, "points.json");
  CHECK(found.height == Approx(1.7));
  CHECK(found.pitch_deg == Approx(10));
  for (std::size_t t = 0; t < scene.places.size(); ++t) {
    REQUIRE(found.places[t]);
    CHECK((*found.places[t] - scene.places[t]).norm() < 0.15);  // the ankles' middle is not under the pelvis
  }
}

TEST_CASE("without ankles nothing is found") {
  Scene scene = walking(1.5, 0, 0, 0, 11);
  for (std::vector<Keypoint>& frame : scene.keypoints.frames)
    frame[static_cast<std::size_t>(smplx_joint("left_ankle"))].confidence = 0.2;
  CHECK_THROWS_WITH(camera_of_person(scene.keypoints, person(), scene.camera, {}, "points.json"),
                    Catch::StartsWith("points.json: no frame shows both ankles"));
  CHECK_THROWS_AS(placed_person(scene.keypoints, person(), scene.camera, "points.json"), DataError);
}

TEST_CASE("ankles above the horizon are nowhere") {
  Scene scene = walking(1.5, 0, 0, 0, 13);
  for (Keypoint& point : scene.keypoints.frames[0]) point.y = 0.1;
  const PersonCamera found = placed_person(scene.keypoints, person(), scene.camera, "points.json");
  CHECK_FALSE(found.places[0]);
  CHECK(found.places[1]);
}

TEST_CASE("the usual focal length is the diagonal") { CHECK(usual_focal_length(300, 400) == 500); }

}  // namespace person_camera_test
