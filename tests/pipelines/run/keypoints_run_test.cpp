// A run that has 2D keypoints of the human: the body goes where they are.
#include <cmath>

#include <catch2/catch.hpp>

#include "body/kinematics.h"
#include "body/motion_io.h"
#include "pipelines/input/clip.h"
#include "tests/support/program.h"
#include "tests/support/tiny_run.h"

namespace keypoints_run_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
namespace fs = std::filesystem;

namespace {

constexpr Index kPoints = 22;  // the first joints of SMPL-X

/// Where a camera sees the first joints of a body, (x, y) each, pixels.
std::vector<double> seen_joints(const Clip& clip, const Rigid<double>& camera_from_world, const BodyPose& pose) {
  const std::vector<double> joints = pose_joints(clip.avatar.parents, clip.avatar.joints, pose);
  std::vector<double> places;
  for (Index j = 0; j < kPoints; ++j) {
    const Vector3<double> p =
        camera_from_world.rotation * Vector3<double>(joints.data() + 3 * j) + camera_from_world.translation;
    places.push_back(clip.camera.fx * p[0] / p[2] + clip.camera.cx);
    places.push_back(clip.camera.fy * p[1] / p[2] + clip.camera.cy);
  }
  return places;
}

/// What a perfect detector would find, of all frames.
nlohmann::json true_keypoints(const Clip& clip) {
  nlohmann::json joints = nlohmann::json::array(), frames = nlohmann::json::array();
  for (Index j = 0; j < kPoints; ++j) joints.push_back(smplx_joint_names()[static_cast<std::size_t>(j)]);
  for (const SceneState& state : *clip.truth) {
    const std::vector<double> places = seen_joints(clip, state.camera_from_world, state.body);
    nlohmann::json frame = nlohmann::json::array();
    for (std::size_t j = 0; j < kPoints; ++j) frame.push_back({places[2 * j], places[2 * j + 1], 1});
    frames.push_back(frame);
  }
  return {{"format", "hsi4d keypoints"}, {"version", 1}, {"joints", joints}, {"frames", frames}};
}

/// Mean distance of a motion's joints from the truth's, frame 0 left out, pixels.
double error_px(const Clip& clip, const std::vector<BodyPose>& poses) {
  double sum = 0;
  for (std::size_t t = 1; t < poses.size(); ++t) {
    const SceneState& truth = (*clip.truth)[t];
    const std::vector<double> a = seen_joints(clip, truth.camera_from_world, poses[t]),
                              b = seen_joints(clip, truth.camera_from_world, truth.body);
    for (std::size_t j = 0; j < kPoints; ++j) sum += std::hypot(a[2 * j] - b[2 * j], a[2 * j + 1] - b[2 * j + 1]);
  }
  return sum / static_cast<double>(kPoints * (poses.size() - 1));
}

void write(const fs::path& file, const nlohmann::json& content) { std::ofstream(file) << content.dump(); }

}  // namespace

TEST_CASE("keypoints alone bring the body to where they are", "[run]") {
  const CopiedDataset dataset;
  const Clip clip = dataset.read();
  write(dataset.path / "keypoints.json", true_keypoints(clip));
  write_changed(dataset.path / "config.json", dataset.path / "changed.json", [](auto& c) {
    c["data"]["keypoints"] = "keypoints.json";
    c["stages"].erase("camera");
    auto& stage = c["stages"]["interaction"];
    stage["iterations"] = 60;
    stage["losses"] = {{"keypoints_2d", {{"weight", 1}}}, {"pose_prior", {{"weight", 1e-3}}}};
    for (const char* group : {"object_orient", "object_transl"}) stage["optimize"].erase(group);
    for (auto& group : stage["optimize"]) group["lr"] = 0.03;
  });
  const RunConfig config =
      load_run_config(dataset.path / "changed.json", {}, descriptions_of(loss_terms()), ConfigUse::kRun);
  const fs::path run = dataset.folder.path() / "run";
  execute_tiny(config, run.string());
  const double before = error_px(clip, clip.estimate),
               after = error_px(clip, read_motion((run / "motion.npz").string()).poses);
  INFO(before << " px before, " << after << " px after");
  CHECK(before > 1);
  CHECK(after < 0.3 * before);

  // They are inputs: other ones are another run, and the message says so.
  write_changed(dataset.path / "keypoints.json", dataset.path / "keypoints.json",
                [](auto& c) { c["frames"][1][0][2] = 0.5; });
  fs::remove(run / "status.json");
  CHECK_THROWS_WITH(execute_tiny(config, run.string(), 1, true),
                    Contains("keypoints.json: is not what the run began with (/data/keypoints: keypoints.json)"));
}

TEST_CASE("without keypoints the term is off, which is told", "[run]") {
  const CopiedDataset dataset;
  write_changed(dataset.path / "config.json", dataset.path / "changed.json", [](auto& c) {
    for (auto& stage : c["stages"]) stage["iterations"] = 1;
    c["stages"]["interaction"]["losses"]["keypoints_2d"] = {{"weight", 1}};
  });
  const std::string config = (dataset.path / "changed.json").string();
  const ProgramResult result =
      run_hsi4d({"run", config, "--threads", "1", "--out", (dataset.folder.path() / "run").string()});
  INFO(result.err);
  CHECK(result.status == 0);
  CHECK_THAT(result.err, Contains("keypoints_2d"));
  CHECK_THAT(run_hsi4d({"check", config, "--set", "data.keypoint_joints=" + config}).err,
             Contains("/data/keypoint_joints: given without /data/keypoints, whose points it tells of"));
}

}  // namespace keypoints_run_test
