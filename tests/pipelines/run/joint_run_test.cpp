// A run with an object on a joint: a gate that a person opens.
#include <cmath>

#include <catch2/catch.hpp>

#include "core/npz.h"
#include "pipelines/config/run_notes.h"
#include "pipelines/input/joint_fit.h"
#include "pipelines/run/depth_bias.h"
#include "pipelines/run/frame_start.h"
#include "tests/support/tiny_run.h"

namespace joint_run_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
namespace fs = std::filesystem;

namespace {

/// A clip of a gate that opens, with its config, in a folder of its own.
struct GateClip {
  TemporaryFolder folder;
  fs::path path = folder.path() / "data";

  GateClip() {
    SyntheticSettings settings = TinyDataset::settings();
    settings.motion = SyntheticMotionKind::kOpen;
    settings.object = SyntheticObjectKind::kGate;
    settings.object_gaussians = 600;
    settings.frame_rate = 2;
    settings.size_px = 96;
    ConfigProblems problems;
    const ConfigValue stages = load_config_text(kTinyStages, "tiny.json", folder.path(), {}, problems);
    problems.throw_if_any();
    write_dataset(settings, video_render_settings(), path, {}, stages);
    write_changed(path / "config.json", path / "joint.json", [](auto& c) {
      c["stages"]["camera"]["iterations"] = 40;
      auto& stage = c["stages"]["interaction"];
      stage["iterations"] = 60;
      stage["losses"] = {{"photometric", {{"ssim_share", 0.1}}}, {"mask", {{"human", false}}}};
      stage["optimize"]["object_joint"] = {{"lr", 0.05}, {"lr_final_share", 0.05}};
    });
  }
  RunConfig config(const std::vector<std::string>& overrides = {}) const {
    return load_run_config(path / "joint.json", overrides, descriptions_of(loss_terms()), ConfigUse::kRun);
  }
};

}  // namespace

TEST_CASE("a generated gate is on the joint that its dataset names", "[run]") {
  const GateClip gate;
  const Clip clip = read_clip(gate.config().data);
  REQUIRE(clip.objects.size() == 1);
  REQUIRE(clip.objects[0].joint);
  const ObjectJoint& joint = *clip.objects[0].joint;
  CHECK(joint.axis == Vector3<double>::UnitZ());
  std::vector<Rigid<double>> poses;
  for (std::size_t t = 0; t < clip.truth->size(); ++t) {
    const Rigid<double> pose = rigid_of((*clip.truth)[t].objects[0]), on = on_joint(joint, joint_value(joint, pose));
    CHECK((on.translation - pose.translation).norm() < 1e-9);
    CHECK((on.rotation - pose.rotation).norm() < 1e-9);
    poses.push_back(pose);
  }
  CHECK(joint_value(joint, poses[0]) == Approx(0).margin(1e-12));
  CHECK(joint_value(joint, poses[3]) > 0.3);
  const JointFit found = fit_joint(JointType::kHinge, poses, clip.objects[0].gaussians);
  CHECK((found.joint.axis - joint.axis).norm() < 1e-6);
  CHECK((found.joint.origin - joint.origin).head<2>().norm() < 1e-6);
}

TEST_CASE("a run finds how far a gate is open, within its limits and on its hinge", "[run]") {
  const GateClip gate;
  const fs::path run = gate.folder.path() / "run", limited = gate.folder.path() / "limited";
  execute_tiny(gate.config(), run.string());
  const Clip clip = read_clip(gate.config().data);
  const ObjectJoint& joint = *clip.objects[0].joint;
  const Npz npz = Npz::read((run / "objects.npz").string());
  const std::vector<double> found = npz.array("gate/joint").require_shape({kTinyFrames}).as<double>();
  const auto poses = read_object_tracks((run / "objects.npz").string(), {"gate"});
  CHECK(found[0] == Approx(0).margin(1e-12));
  for (std::size_t t = 1; t < poses.size(); ++t) {
    const double truth = joint_value(joint, rigid_of((*clip.truth)[t].objects[0]));
    INFO("frame " << t << ": " << found[t] << " for " << truth);
    CHECK(std::abs(found[t] - truth) < 0.06);
    const Rigid<double> on = on_joint(joint, found[t]);
    CHECK((on.translation - poses[t][0].translation).norm() < 1e-9);
  }
  execute_tiny(gate.config({"data.objects.gate.joint.limits=[0,0.2]"}), limited.string());
  const Npz held = Npz::read((limited / "objects.npz").string());
  const std::vector<double> values = held.array("gate/joint").as<double>();
  CHECK(values[3] == Approx(0.2).epsilon(1e-6));
}

TEST_CASE("a run on a joint is another run with another joint, and starts on it", "[run]") {
  const GateClip gate;
  const fs::path run = gate.folder.path() / "run";
  execute_tiny(gate.config(), run.string());
  RunOptions options;
  options.folder = run.string();
  options.resume = true;
  CHECK_THROWS_WITH(execute_run(gate.config({"data.objects.gate.joint.limits=[0,0.2]"}), loss_terms(), options),
                    Contains("joint"));

  // Poses that know nothing of the joint.
  Clip clip = read_clip(gate.config().data);
  const ObjectJoint& joint = *clip.objects[0].joint;
  clip.object_estimate.resize(clip.truth->size());
  for (std::size_t t = 0; t < clip.truth->size(); ++t) {
    clip.object_estimate[t] = (*clip.truth)[t].objects;
    clip.object_estimate[t][0].translation += Vector3<double>(0.03, -0.02, 0.05);
  }
  const StartSettings by_estimate{.objects = StartFrom::kEstimate};
  for (const SceneState& state : {given_start(clip, 3), frame_start(by_estimate, clip, {3, clip.first})}) {
    const Rigid<double> pose = rigid_of(state.objects[0]), on = on_joint(joint, joint_value(joint, pose));
    CHECK((on.translation - pose.translation).norm() < 1e-9);
    CHECK((on.rotation - pose.rotation).norm() < 1e-9);
    CHECK(joint_value(joint, pose) > 0.3);
  }
}

TEST_CASE("an object on a joint stays on it where a frame hides it", "[run]") {
  const GateClip gate;
  Image sliver(1, 96, 96);
  for (int x = 40; x < 44; ++x) sliver(0, 50, x) = 1;
  write_image((gate.path / "masks/gate/0002.png").string(), sliver);
  const fs::path run = gate.folder.path() / "run";
  execute_tiny(gate.config({"start.objects=best"}), run.string());
  const Clip clip = read_clip(gate.config().data);
  const ObjectJoint& joint = *clip.objects[0].joint;
  for (const auto& frame : read_object_tracks((run / "objects.npz").string(), {"gate"})) {
    const Rigid<double> pose = rigid_of(frame[0]), on = on_joint(joint, joint_value(joint, pose));
    CHECK((on.translation - pose.translation).norm() < 1e-9);
    CHECK((on.rotation - pose.rotation).norm() < 1e-9);
  }
  CHECK_THAT(file_text(run / "log.txt"), !Contains("gate is hidden"));
}

TEST_CASE("what is wrong with joints is named", "[run]") {
  const GateClip gate;
  const auto fault = [&gate](const std::vector<std::string>& overrides) {
    try {
      gate.config(overrides);
    } catch (const UserError& problem) {
      return std::string(problem.what());
    }
    return std::string();
  };
  const std::string joint = "data.objects.gate.joint.";
  CHECK_THAT(fault({joint + "axis=[0,0,0]"}), Contains("an axis of length 0 has no direction"));
  CHECK_THAT(fault({joint + "limits=[0.1,1]"}), Contains("0 is where the object is in frame 0"));
  CHECK_THAT(fault({joint + "limits=[0,4]"}), Contains("a hinge turns by half a turn at most"));
  CHECK_THAT(
      fault({joint + "parent=gate"}),
      Contains("the joint of \"gate\" has the parent \"gate\", which is no object that is named before; allowed: "
               "\"\", the scene"));
  CHECK_THAT(fault({joint + "type=free", joint + "parent=can"}), Contains("an object that is free has no parent"));
  CHECK_THAT(fault({joint + "type=free"}), Contains("an object that is free has no parent, axis, origin"));
  CHECK_THAT(fault({joint + "type=slide"}), Contains("a slide has a direction alone"));
  RunConfig still = gate.config();
  for (auto& [name, stage] : still.stages)
    std::erase_if(stage.optimize, [](const auto& group) { return group.first == "object_joint"; });
  std::string text;
  for (const RunNote& note : run_notes(still)) text += note.text + "\n";
  CHECK_THAT(text, Contains("data.objects.gate: is on a joint along which it does not move"));
}

TEST_CASE("the bias of depths leaves objects on their joints, and what hangs on a free one goes along", "[run]") {
  const GateClip gate;
  Clip clip = read_clip(gate.config().data);
  SceneState state = (*clip.truth)[2];
  const SceneState before = state;
  remove_depth_bias(clip, {1.01, {1.02}}, state);
  CHECK(state.objects[0].translation == before.objects[0].translation);
  CHECK((state.body.transl - before.body.transl).norm() > 0.01);
  clip.objects.push_back(clip.objects[0]);
  clip.objects[0].joint.reset();
  clip.objects[1].joint->parent = 0;
  state.objects.push_back({{0.1, 0.2, 0.3}, {0.4, 0.5, 0.6}});
  const Rigid<double> relative = parent_from_object(*clip.objects[1].joint, state.objects, 1);
  remove_depth_bias(clip, {1, {1.02, 1.03}}, state);
  CHECK((state.objects[0].translation - before.objects[0].translation).norm() > 0.01);
  const Rigid<double> after = parent_from_object(*clip.objects[1].joint, state.objects, 1);
  CHECK((after.translation - relative.translation).norm() < 1e-12);
}

}  // namespace joint_run_test
