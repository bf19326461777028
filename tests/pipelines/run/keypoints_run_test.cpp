// A run that has 2D keypoints of the human: the body goes where they are.
#include <cmath>
#include <numbers>

#include <catch2/catch.hpp>

#include "core/rotation.h"
#include "pipelines/input/clip.h"
#include "pipelines/metrics/keypoint_errors.h"
#include "pipelines/run/heading_starts.h"
#include "tests/support/program.h"
#include "tests/support/tiny_run.h"
#include "tests/support/true_keypoints.h"

namespace keypoints_run_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
namespace fs = std::filesystem;

namespace {

/// Mean distance of a motion's joints from the truth's, frame 0 left out, pixels.
double error_px(const Clip& clip, const std::vector<BodyPose>& poses) {
  double sum = 0;
  for (std::size_t t = 1; t < poses.size(); ++t) {
    const SceneState& truth = (*clip.truth)[t];
    const std::vector<double> a = seen_joints(clip, truth.camera_from_world, poses[t]),
                              b = seen_joints(clip, truth.camera_from_world, truth.body);
    for (std::size_t j = 0; j < kTruePoints; ++j) sum += std::hypot(a[2 * j] - b[2 * j], a[2 * j + 1] - b[2 * j + 1]);
  }
  return sum / static_cast<double>(kTruePoints * (poses.size() - 1));
}

/// Angle between two bodies' root rotations.
double rotation_angle_deg(const BodyPose& a, const BodyPose& b) {
  const Matrix3<double> turn =
      so3_exp(Vector3<double>(a.axis_angle.data())) * so3_exp(Vector3<double>(b.axis_angle.data())).transpose();
  return so3_log(Matrix3<double>(turn)).norm() * 180 / std::numbers::pi;
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
  const nlohmann::json summary = json_of(run / "summary.json");
  // By the run's camera, which stands still here, where the truth's does not.
  const double found = summary["metrics"][0]["keypoints_px"], start = summary["baselines"]["start"]["keypoints_px"];
  INFO(start << " px of the summary's start, " << found << " px of its result");
  CHECK(found < 0.2 * start);
  CHECK(summary["per_frame"].back().contains("keypoints_px"));

  // They are inputs: other ones are another run, and the message says so.
  write_changed(dataset.path / "keypoints.json", dataset.path / "keypoints.json",
                [](auto& c) { c["frames"][1][0][2] = 0.5; });
  fs::remove(run / "status.json");
  CHECK_THROWS_WITH(execute_tiny(config, run.string(), 1, true),
                    Contains("keypoints.json: is not what the run began with (/data/keypoints: keypoints.json)"));
}

TEST_CASE("the pose of frame 0 is found from keypoints, whichever way the person was put there", "[run]") {
  const CopiedDataset dataset;
  const Clip clip = dataset.read();
  write(dataset.path / "keypoints.json", true_keypoints(clip));
  Motion motion = read_motion((dataset.path / "initial_motion.npz").string());
  motion.poses.resize(1);
  BodyPose& first = motion.poses.front();
  const Vector3<double> root(first.axis_angle.data());
  first = rest_pose(kSmplxJoints);  // arms out, turned to the other side and put elsewhere
  first.transl = clip.first.body.transl + Vector3<double>(0.2, -0.15, 0);
  first.set_rotation(0, so3_log(Matrix3<double>(so3_exp(Vector3<double>(0, 0, 2.6)) * so3_exp(root))));
  write_motion((dataset.path / "initial_motion.npz").string(), motion);
  write_changed(dataset.path / "initial.json", dataset.path / "initial.json",
                [](auto& initial) { initial.erase("object_tracks"); });
  write_changed(fs::path(HSI4D_SOURCE_DIR) / "configs" / "from_keypoints.json", dataset.path / "changed.json",
                [&](auto& c) {
                  c["extends"] = "config.json";
                  c.erase("remove_depth_bias");
                  c["data"]["keypoints"] = "keypoints.json";
                  for (const char* stage : {"fit_first_frame", "refinement"}) c["stages"].erase(stage);
                  for (const char* stage : {"camera", "interaction"}) c["stages"][stage] = {{"iterations", 1}};
                  c["stages"]["fit_first_pose"]["losses"]["keypoints_2d"]["weight"] = 0.1;  // of 48 pixels
                });
  const RunConfig config =
      load_run_config(dataset.path / "changed.json", {}, descriptions_of(loss_terms()), ConfigUse::kRun);
  REQUIRE(config.stages.front().second.headings == 8);
  const auto error = [&](int headings) {
    RunConfig tried = config;
    tried.stages.front().second.headings = headings;
    const fs::path run = dataset.folder.path() / ("run" + std::to_string(headings));
    execute_tiny(tried, run.string());
    if (headings > 1)
      CHECK_THAT(file_text(run / "log.txt"), Contains("start of stage fit_first_pose: headings +0 deg: "));
    const BodyPose found = read_motion((run / "motion.npz").string()).poses.front();
    return rotation_angle_deg(found, clip.first.body);
  };
  const double from_eight = error(8), from_one = error(1);
  INFO(from_eight << " deg of the root from eight headings, " << from_one << " from one");
  CHECK(from_eight < 20);
  CHECK(from_one > 45);  // it looks the other way
}

TEST_CASE("the distance from keypoints is measured by frame, of points that were found") {
  const CopiedDataset dataset;
  write(dataset.path / "keypoints.json", true_keypoints(dataset.read()));
  const Clip clip = dataset.read();
  REQUIRE(clip.keypoints);
  for (const MetricValues& frame : keypoint_errors_by_frame(clip, *clip.truth))
    CHECK(number_in(frame, "keypoints_px") < 1e-6);
  Clip other = clip;
  std::vector<Keypoint>& points = other.keypoints->frames[1];
  for (std::size_t k = 0; k < points.size(); ++k) {
    points[k].x += 3.0 / clip.camera.width;
    points[k].y -= 4.0 / clip.camera.height;
    if (k > 0) points[k].confidence = 0.4;  // not found
  }
  for (Keypoint& point : other.keypoints->frames[2]) point.confidence = 0;
  const std::vector<MetricValues> values = keypoint_errors_by_frame(other, *clip.truth);
  CHECK(number_in(values[1], "keypoints_px") == Approx(5));
  CHECK(values[2].empty());
  other.keypoints.reset();
  CHECK(keypoint_errors_by_frame(other, *clip.truth)[1].empty());
}

TEST_CASE("headings are of a stage over the first frame") {
  const TemporaryFolder here;
  here.write("a.json", R"({"stages": {"s": {"iterations": 1, "headings": 4, "optimize": {"transl": {"lr": 1}},
    "losses": {"keypoints_2d": {}}}}})");
  CHECK_THAT(run_hsi4d({"check", "a.json"}).err, Contains("/stages/s/headings: 4 headings are tried by a stage over "
                                                          "\"first_frame\" that draws \"all\"; allowed here: 1"));
}

TEST_CASE("a human is turned about its pelvis, and the heading with the least loss is kept") {
  SceneState state;
  state.body = rest_pose(kSmplxJoints);
  state.body.transl = {1, 2, 3};
  state.body.set_rotation(0, Vector3<double>(1.5, 0.2, 0.1));
  const SceneState turned = with_turned_human(state, 1.2);
  CHECK(turned.body.transl == state.body.transl);  // a body turns about its pelvis
  const Matrix3<double> root = so3_exp(Vector3<double>(turned.body.axis_angle.data())),
                        wanted = so3_exp(Vector3<double>(0, 0, 1.2)) * so3_exp(Vector3<double>(1.5, 0.2, 0.1));
  CHECK((root - wanted).norm() < 1e-12);
  int tries = 0;
  const HeadingStart best = best_heading(state, 4, [&](const SceneState& start) {
    ++tries;
    const double losses[] = {std::nan(""), 3, 2, 2};
    CHECK(rotation_angle_deg(start.body, state.body) == Approx(tries == 4 ? 90 : 90 * (tries - 1)).margin(1e-9));
    return losses[tries - 1];
  });
  CHECK(tries == 4);
  CHECK(rotation_angle_deg(best.state.body, state.body) == Approx(180));
  CHECK(best.text == "headings +0 deg: nan, +90 deg: 3, +180 deg: 2 (kept), +270 deg: 2");
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
  CHECK_THAT(result.err, Contains("the loss \"keypoints_2d\" is off: "));
  CHECK_THAT(run_hsi4d({"check", config, "--set", "data.keypoint_joints=" + config}).err,
             Contains("/data/keypoint_joints: given without /data/keypoints, whose points it tells of"));
}

}  // namespace keypoints_run_test
