#include "pipelines/draw/camera_selection.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <catch2/catch.hpp>

#include "body/procedural_body.h"
#include "core/camera_file.h"
#include "core/check.h"
#include "core/rotation.h"
#include "tests/support/program.h"
#include "tests/support/tiny_run.h"

namespace camera_selection_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

using Vector = Vector3<double>;

/// Flat Gaussians without holes: a wall from `corner` along two edges.
void add_wall(Gaussians& scene, const Vector& corner, const Vector& across, const Vector& up) {
  constexpr int kCells = 24;
  for (int i = 0; i <= kCells; ++i) {
    for (int j = 0; j <= kCells; ++j) {
      const Vector place = corner + across * (double(i) / kCells) + up * (double(j) / kCells);
      for (int c = 0; c < 3; ++c) scene.means.push_back(static_cast<float>(place[c]));
      scene.quats.insert(scene.quats.end(), {1, 0, 0, 0});
      const double cell = std::max(across.norm(), up.norm()) / kCells;
      scene.log_scales.insert(scene.log_scales.end(), 3, static_cast<float>(std::log(0.7 * cell)));
      scene.opacity_logits.push_back(6);
      scene.sh.insert(scene.sh.end(), {0.5F, 0, -0.5F});
    }
  }
}

/// A human at the origin who faces -y (global_orient of +90 degrees about x), before a wall far behind.
SceneSetup standing() {
  SceneSetup setup;
  AvatarSettings avatar;
  avatar.gaussians = 3000;
  setup.avatar = surface_avatar(procedural_body(), avatar);
  BodyPose pose = rest_pose(kSmplxJoints);
  pose.set_rotation(0, {std::numbers::pi / 2, 0, 0});
  pose.transl = {0, 0, 1.25};
  setup.motion.poses = {pose};
  add_wall(setup.scene, {-6, 6, 0}, {12, 0, 0}, {0, 0, 4});
  return setup;
}

CameraSelectionSettings few_candidates() {
  CameraSelectionSettings settings;
  settings.radii_m = {3};
  settings.azimuths = 12;
  settings.elevations_deg = {15, 0};
  settings.trial_px = 96;
  return settings;
}

Vector center_of(const Rigid<double>& camera) { return -(camera.rotation.transpose() * camera.translation); }

}  // namespace

TEST_CASE("candidates look at the centre, from the side that the human faces but not squarely") {
  const SceneSetup setup = standing();
  CHECK((heading_of(setup.motion.poses[0]) - Vector(0, -1, 0)).norm() < 1e-12);
  const CameraSelectionSettings settings = few_candidates();
  const Vector center = view_center(setup, settings);
  const std::vector<double> joints = pose_joints(setup.avatar, setup.motion.poses[0]);
  CHECK((center - Vector(joints[0], joints[1], joints[2] + 0.1)).norm() < 1e-12);
  const std::vector<CandidateView> views = candidate_views(setup, settings);
  CHECK(views.size() == 2 * 4);  // at 30 and 60 degrees to both sides; the one at 0 is too frontal, 15 degrees up too
  for (const CandidateView& view : views) {
    const Vector out = center_of(view.camera_from_world) - center;
    CHECK(out.norm() == Approx(3).epsilon(1e-12));
    CHECK(out.dot(Vector(0, -1, 0)) > 0);
    CHECK(std::acos(out.dot(Vector(0, -1, 0)) / 3) >= 20 * std::numbers::pi / 180 - 1e-9);
    const Vector seen = transform_point(view.camera_from_world, center);
    CHECK(std::hypot(seen[0], seen[1]) < 1e-9);
  }
}

TEST_CASE("with objects candidates look between the human and the farthest of them that it faces") {
  SceneSetup setup = standing();
  ClipObject object{"box", {}};
  add_wall(object.gaussians, {-0.1, 0, -0.1}, {0.2, 0, 0}, {0, 0, 0.2});
  setup.objects = {object, object};
  setup.poses = {{{0, 0, 0}, {0.5, -1.2, 1}}, {{0, 0, 0}, {0, 2, 1}}};  // one 1.2 m before, one behind
  const CameraSelectionSettings settings = few_candidates();
  const std::vector<double> joints = pose_joints(setup.avatar, setup.motion.poses[0]);
  const double ahead = (joints[1] + 1.2) / 2;
  CHECK((view_center(setup, settings) - Vector(joints[0], joints[1] - ahead, joints[2] + 0.1)).norm() < 1e-6);
}

TEST_CASE("joints behind a wall are not counted, and the view with most of them is taken") {
  SceneSetup setup = standing();
  const CameraSelectionSettings settings = few_candidates();
  const CameraChoice free = select_camera(setup, settings, {});
  CHECK(free.candidates.front().visible == 22);
  CHECK(free.candidates.front().elevation_deg == 0);  // of equals the one nearest to the horizon
  CHECK(count_visible(setup, free.camera, settings, {}) == 22);
  // A wall from the floor to the belt on the side of -x hides the legs from there.
  add_wall(setup.scene, {-0.9, -3, 0}, {0, 3.5, 0}, {0, 0, 0.8});
  const CameraChoice choice = select_camera(setup, settings, {});
  CHECK(choice.candidates.front().visible == 22);
  for (const CandidateView& view : choice.candidates) {
    const bool is_hidden = center_of(view.camera_from_world)[0] < -1.2 && view.elevation_deg == 0;
    INFO("azimuth " << view.azimuth_deg << ", elevation " << view.elevation_deg);
    if (is_hidden) CHECK(view.visible < 20);
    if (is_hidden) CHECK(view.visible > 5);
  }
}

TEST_CASE("of views with as many joints one is taken whose image is covered, where that is asked for") {
  SceneSetup setup = standing();
  setup.scene = {};
  add_wall(setup.scene, {-6, 2, -2}, {8, 0, 0}, {0, 0, 8});  // behind the human as it is seen from +x
  CameraSelectionSettings settings = few_candidates();
  settings.by_cover = true;
  const CameraChoice choice = select_camera(setup, settings, {});
  const CandidateView& best = choice.candidates.front();
  REQUIRE(best.visible == 22);
  CHECK(center_of(best.camera_from_world)[0] > 0);
  CHECK(best.cover.value() > 0.9);
  const auto is_empty = [](const CandidateView& view) { return view.visible == 22 && view.cover.value() < 0.7; };
  CHECK(std::any_of(choice.candidates.begin(), choice.candidates.end(), is_empty));
  for (const CandidateView& view : choice.candidates) CHECK(view.cover.has_value() == (view.visible == 22));
  // By the paper's rule alone the view nearest to the horizon is taken, and the first of these.
  const CameraChoice plain = select_camera(setup, few_candidates(), {});
  CHECK(plain.candidates.front().elevation_deg == 0);
  for (const CandidateView& view : plain.candidates) CHECK_FALSE(view.cover.has_value());
  setup.scene = {};
  add_wall(setup.scene, {-2, 2, -2}, {8, 0, 0}, {0, 0, 8});  // behind it as it is seen from -x
  CHECK(center_of(select_camera(setup, settings, {}).camera.camera_from_world)[0] < 0);
  CHECK(center_of(select_camera(setup, few_candidates(), {}).camera.camera_from_world) ==
        center_of(plain.camera.camera_from_world));
}

TEST_CASE("a human that nobody can see, or that lies, is told") {
  SceneSetup setup = standing();
  for (const double side : {-1.0, 1.0}) {
    add_wall(setup.scene, {side, -1, -0.5}, {0, 2, 0}, {0, 0, 3});
    add_wall(setup.scene, {-1, side, -0.5}, {2, 0, 0}, {0, 0, 3});
  }
  CHECK_THROWS_WITH(select_camera(setup, few_candidates(), {}),
                    "no joint of the human is to be seen from any of 8 candidates; camera_selection.radii_m says "
                    "how far away they are");
  setup.motion.poses[0].set_rotation(0, Vector::Zero());  // faces up
  CHECK_THROWS_WITH(select_camera(setup, few_candidates(), {}),
                    "the human of frame 0 faces up or down: it has no heading to choose a view by");
}

TEST_CASE("select-camera writes a camera that a run can read, and what it sees") {
  const TemporaryFolder here;
  const std::string config = (TinyDataset::folder() / "config.json").string();
  const ProgramResult result = run_hsi4d({"select-camera", config, "--quiet", "--out", "camera.json", "--image",
                                          "view.png", "--set", "camera_selection.radii_m=[2]"});
  INFO(result.err);
  REQUIRE(result.status == 0);
  CHECK(result.out.find("VISIBLE") == 0);
  const Camera camera = read_camera("camera.json"),
               given = read_camera((TinyDataset::folder() / "camera.json").string());
  CHECK(camera.width == given.width);
  CHECK(camera.fx == given.fx);
  CHECK(std::filesystem::exists("view.png"));
  const ProgramResult missing = run_hsi4d({"select-camera", config, "--set", "data.scene=", "--set", "data.initial="});
  CHECK(missing.status == 2);
  CHECK(missing.err.find(
            "/data/scene, /data/initial: not given; a camera is chosen by the scene, the human and the state "
            "of frame 0\n") != std::string::npos);
}

}  // namespace camera_selection_test
