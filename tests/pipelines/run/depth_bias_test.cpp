// The bias of depths that frame 0 tells, and runs that remove it.
#include "pipelines/run/depth_bias.h"

#include <limits>

#include <catch2/catch.hpp>

#include "body/motion_io.h"
#include "core/camera_file.h"
#include "pipelines/config/run_problems.h"
#include "tests/support/tiny_run.h"

namespace depth_bias_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
namespace fs = std::filesystem;

namespace {

constexpr double kThreshold = 0.5;

Clip tiny_clip() { return read_run_clip(tiny_config(), loss_terms()); }

Vector3<double> center_of(const Rigid<double>& camera) { return -(camera.rotation.transpose() * camera.translation); }

Vector3<double> pelvis_of(const Clip& clip, const BodyPose& body) {
  return Vector3<double>(clip.avatar.joints.data()) + body.transl;
}

/// Human and object further from the camera by these factors.
SceneState further(const Clip& clip, double human, double object) {
  SceneState state = clip.first;
  const Vector3<double> center = center_of(state.camera_from_world);
  state.body.transl += (human - 1) * (pelvis_of(clip, state.body) - center);
  state.objects[0].translation += (object - 1) * (state.objects[0].translation - center);
  return state;
}

/// What the log of a run tells, of human and object.
std::pair<double, double> told_factors(const std::string& folder) {
  const std::string log = file_text(folder + "/log.txt"), before = "distances times human ";
  const std::size_t at = log.find(before);
  REQUIRE(at != std::string::npos);
  const std::string of_object = ", " + kTinyObject + " ";
  return {std::stod(log.substr(at + before.size())), std::stod(log.substr(log.find(of_object, at) + of_object.size()))};
}

}  // namespace

TEST_CASE("the factors of a fit that is too far away are found and taken back") {
  const Clip clip = tiny_clip();
  const ClipFrame frame = read_frame(clip, 0);
  const DepthBias found = depth_bias(clip, frame, kThreshold, clip.first, further(clip, 1.01, 0.98));
  CHECK(found.human == Approx(1.01).epsilon(1e-12));
  REQUIRE(found.objects.size() == 1);
  CHECK(found.objects[0] == Approx(0.98).epsilon(1e-12));
  SceneState back = further(clip, 1.01, 0.98);
  remove_depth_bias(clip, found, back);
  CHECK((back.body.transl - clip.first.body.transl).norm() < 1e-12);
  CHECK((back.objects[0].translation - clip.first.objects[0].translation).norm() < 1e-12);
  CHECK(depth_bias_text(clip, found) == "human 1.01, " + kTinyObject + " 0.98");
}

TEST_CASE("a fit that is lost, and what frame 0 does not show, tell no bias") {
  const Clip clip = tiny_clip();
  ClipFrame frame = read_frame(clip, 0);
  const DepthBias lost = depth_bias(clip, frame, kThreshold, clip.first, further(clip, 1 + 1.1 * kMostDepthBias, 0.9));
  CHECK(lost.human == 1);
  CHECK(lost.objects[0] == 1);
  SceneState broken = clip.first;
  broken.body.transl[0] = std::numeric_limits<double>::quiet_NaN();
  CHECK(depth_bias(clip, frame, kThreshold, clip.first, broken).human == 1);
  frame.object_masks[0] = Image(1, clip.camera.height, clip.camera.width);
  const DepthBias unseen = depth_bias(clip, frame, kThreshold, clip.first, further(clip, 1.01, 0.98));
  CHECK(unseen.human == Approx(1.01));
  CHECK(unseen.objects[0] == 1);
}

TEST_CASE("a run takes the bias of frame 0 from all later frames, with the same bits after an interruption") {
  const TemporaryFolder here;
  const Clip clip = tiny_clip();
  execute_tiny(tiny_config(), "kept");
  const RunConfig config = tiny_config({"remove_depth_bias=true"});
  execute_tiny(config, "removed");
  const auto [human, object] = told_factors("removed");
  CHECK(human != 1);
  const Motion kept = read_motion("kept/motion.npz"), removed = read_motion("removed/motion.npz");
  const auto objects = read_object_tracks("kept/objects.npz", {kTinyObject}),
             moved = read_object_tracks("removed/objects.npz", {kTinyObject});
  const std::vector<Camera> cameras = read_cameras("removed/cameras.json");
  CHECK(kept.poses[0].transl == removed.poses[0].transl);
  CHECK(objects[0][0].translation == moved[0][0].translation);
  for (std::size_t t = 1; t < kept.poses.size(); ++t) {
    INFO("frame " << t);
    const Vector3<double> center = center_of(cameras[t].camera_from_world);
    const Vector3<double> far = pelvis_of(clip, kept.poses[t]) - center,
                          near = pelvis_of(clip, removed.poses[t]) - center;
    CHECK((near * human - far).norm() < 1e-5 * far.norm());
    const Vector3<double> thing = objects[t][0].translation - center;
    CHECK(((moved[t][0].translation - center) * object - thing).norm() < 1e-5 * thing.norm());
    CHECK(kept.poses[t].axis_angle == removed.poses[t].axis_angle);
  }
  int asked = 0;
  const int late = (kTinyFrames - 1) * kPerFrame + 3;  // in the fit of frame 0
  CHECK_THROWS_AS(execute_tiny(config, "stopped", 1, false, [&] { return ++asked > late; }), Interrupted);
  execute_tiny(config, "stopped", 2, true);
  for (const char* file : {"motion.npz", "objects.npz", "cameras.json"})
    CHECK(file_text(std::string("stopped/") + file) == file_text(std::string("removed/") + file));
}

TEST_CASE("a frame 0 that stages have yet to find tells no bias") {
  RunConfig config = tiny_config({"remove_depth_bias=true"});
  StageSettings stage = config.stages.back().second;
  stage.over = StageScope::kFirst;
  config.stages.insert(config.stages.begin(), {"fit_first_frame", stage});
  const std::vector<RunProblem> problems = run_problems(config, ConfigUse::kStages);
  REQUIRE(problems.size() == 1);
  CHECK(problems[0].pointer == "/remove_depth_bias");
  CHECK_THAT(problems[0].text, Contains("fit_first_frame") && Contains("allowed: false"));
}

}  // namespace depth_bias_test
