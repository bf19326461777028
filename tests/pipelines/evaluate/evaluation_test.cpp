// Worlds, bodies, rates and objects of motions that other programs have made, as evaluate() brings them together.
#include "pipelines/evaluate/evaluation.h"

#include <cmath>
#include <numbers>

#include <catch2/catch.hpp>

#include "body/motion_edit.h"
#include "body/motion_io.h"
#include "core/check.h"
#include "core/npz.h"
#include "core/rotation.h"
#include "core/text.h"
#include "pipelines/evaluate/baseline_export.h"
#include "pipelines/input/body_files.h"
#include "tests/optim/solid/meshes.h"
#include "tests/support/procedural_file.h"
#include "tests/support/tiny_run.h"

namespace evaluation_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;

namespace {

using Point = Vector3<double>;

std::string data(const std::string& name = "") { return (TinyDataset::folder() / name).string(); }

Motion true_motion() { return read_motion(data("truth/motion.npz")); }

std::vector<std::vector<ObjectPose>> true_objects() {
  return read_object_tracks(data("truth/objects.npz"), {kTinyObject});
}

/// A motion by the names of smplx, which say neither rate nor pelvis nor what is up; with an object where one is given.
struct ForeignFile {
  Motion motion;
  std::vector<std::vector<ObjectPose>> objects = {};
  std::string places = "obj_com_pos";
  double rate = 0;  // 0: it does not say

  void write(const std::string& path) const {
    NpzWriter file;
    const auto frames = static_cast<std::int64_t>(motion.poses.size());
    std::vector<double> transl, root, body, rotations, translations;
    for (const BodyPose& pose : motion.poses) {
      transl.insert(transl.end(), pose.transl.data(), pose.transl.data() + 3);
      root.insert(root.end(), pose.axis_angle.begin(), pose.axis_angle.begin() + 3);
      body.insert(body.end(), pose.axis_angle.begin() + 3, pose.axis_angle.begin() + 66);
    }
    file.add<double>("transl", {frames, 3}, transl);
    file.add<double>("global_orient", {frames, 3}, root);
    file.add<double>("body_pose", {frames, 63}, body);
    if (!motion.betas.empty()) file.add<double>("betas", {std::ssize(motion.betas)}, motion.betas);
    if (rate > 0) file.add_scalar("fps", rate);
    for (const std::vector<ObjectPose>& poses : objects) {
      const Matrix3<double> rotation = so3_exp(poses[0].rotation);
      for (int r = 0; r < 3; ++r) rotations.insert(rotations.end(), {rotation(r, 0), rotation(r, 1), rotation(r, 2)});
      translations.insert(translations.end(), poses[0].translation.data(), poses[0].translation.data() + 3);
    }
    if (!objects.empty()) {
      file.add<double>("obj_rot_mat", {frames, 3, 3}, rotations);
      file.add<double>(places, {frames, 3}, translations);
    }
    file.write(path);
  }
};

/// A foreign file of a movement in another world.
ForeignFile moved(const Motion& motion, const std::vector<std::vector<ObjectPose>>& objects,
                  const Rigid<double>& to_from, const Point& pelvis) {
  ForeignFile file{transformed(motion, to_from, pelvis), objects};
  for (std::vector<ObjectPose>& poses : file.objects) {
    for (ObjectPose& pose : poses)
      pose = {so3_log(Matrix3<double>(to_from.rotation * so3_exp(pose.rotation))),
              transform_point(to_from, pose.translation)};
  }
  return file;
}

Point true_pelvis() { return true_motion().pelvis_rest.value_or(kSmplxPelvis); }

/// The movement of the truth for a body with the pelvis of SMPL-X, which the files of others are for.
Motion for_others(const Motion& motion) { return for_body(motion, kSmplxName, kSmplxPelvis); }

/// Stands still, z up, at (1, 2, 1).
Motion still(double frame_rate, std::vector<double> betas) {
  Motion motion;
  motion.frame_rate = frame_rate;
  motion.betas = std::move(betas);
  BodyPose pose = rest_pose(kSmplxJoints);
  pose.set_rotation(0, Point(std::numbers::pi / 2, 0, 0));
  pose.transl = {1, 2, 1};
  motion.poses.assign(4, pose);
  return motion;
}

double value(const Evaluation& evaluation, const char* name) {
  INFO(name);
  const double* const found = find_metric(evaluation.values, name);
  REQUIRE(found != nullptr);
  return *found;
}

const Rigid<double> kElsewhere{so3_exp(Point(0, 0, 1)), {7, -5, 0.2}};
const Rigid<double> kYUp = inverse(z_up_from_y_up());

}  // namespace

TEST_CASE("an estimate that is laid on frame 0 keeps its own frame 0") {
  const TemporaryFolder here;
  Motion motion = transformed(true_motion(), kElsewhere, true_pelvis());
  for (BodyPose& pose : motion.poses) pose.set_rotation(18, pose.rotation_of(18) + Point(0, 0.4, 0));
  write_motion("m.npz", motion);
  EvaluationSettings settings;
  settings.truth = data();
  const Evaluation apart = evaluate(settings, "m.npz", "");
  for (const MotionAlign align : {MotionAlign::kHeading, MotionAlign::kRotation}) {
    settings.align = align;
    const Evaluation laid = evaluate(settings, "m.npz", "");
    // What a rigid movement of the world does not change.
    CHECK(value(laid, "jitter") == Approx(value(apart, "jitter")).epsilon(1e-9));
    CHECK(value(apart, "jitter") > 0);
    CHECK(value(laid, "root_translation_mm") < 1e-6);
    CHECK(value(laid, "world_mpjpe_mm") == Approx(value(laid, "mpjpe_mm")).margin(1e-6));
    CHECK(value(laid, "mpjpe_mm") > 3);  // the elbow's, in every frame
    const Evaluation truth = evaluate(settings, data(), "");
    const auto wrist = static_cast<std::size_t>(3 * smplx_joint("left_wrist"));
    CHECK((Point(laid.joints[0].data() + wrist) - Point(truth.joints[0].data() + wrist)).norm() > 0.05);
  }
}

TEST_CASE("bodies of two shapes are laid pelvis on pelvis") {
  const TemporaryFolder here;
  procedural_file(Point(0.05, 0.3, -0.1)).write("body.npz");
  write_motion("truth.npz", still(10, {0}));
  const Motion other = still(10, {1});
  write_motion("m.npz", transformed(other, kElsewhere, kSmplxPelvis + Point(0.05, 0.3, -0.1)));
  EvaluationSettings settings;
  settings.truth = "truth.npz";
  settings.body_model = "body.npz";
  settings.align = MotionAlign::kHeading;
  const Evaluation laid = evaluate(settings, "m.npz", "");
  CHECK(value(laid, "world_mpjpe_mm") < 1e-6);
  settings.align = MotionAlign::kNone;
  CHECK(value(evaluate(settings, "m.npz", ""), "world_mpjpe_mm") > 1000);
}

TEST_CASE("a motion with y up turns about the pelvis of its own shape") {
  const TemporaryFolder here;
  const Point shift(0.05, 0.3, -0.1);
  procedural_file(shift).write("body.npz");
  const Motion motion = still(10, {1});
  write_motion("truth.npz", motion);
  const Point pelvis = pelvis_of(procedural_body().joints) + shift;
  ForeignFile{transformed(motion, kYUp, pelvis), {}, "", 10}.write("m.npz");
  EvaluationSettings settings;
  settings.truth = "truth.npz";
  settings.body_model = "body.npz";
  CHECK(value(evaluate(settings, "m.npz", ""), "world_mpjpe_mm") < 1e-6);
  settings.up = UpAxis::kY;
  CHECK(value(evaluate(settings, "m.npz", ""), "world_mpjpe_mm") < 1e-6);
}

TEST_CASE("who lies along y is not taken to stand with y up, where it is known how the body begins") {
  const TemporaryFolder here;
  for (const double side : {-1.0, 1.0}) {
    const Rigid<double> lies{so3_exp(Point(side * std::numbers::pi / 2, 0, 0)), {0, 0, 0}};
    const Motion motion = transformed(for_others(true_motion()), lies, kSmplxPelvis);
    write_motion("truth.npz", motion);
    ForeignFile{motion, {}, "", 10}.write("m.npz");
    EvaluationSettings settings;
    settings.truth = "truth.npz";
    settings.avatar = data("avatar.safetensors");
    const Evaluation lying = evaluate(settings, "m.npz", "");
    CHECK(value(lying, "world_mpjpe_mm") < 1e-6);
    CHECK_THAT(joined(lying.notes, "; "), Contains("z is up, as the body is in frame 0"));
    // The same in a world of y up.
    ForeignFile{transformed(motion, kYUp, kSmplxPelvis), {}, "", 10}.write("y.npz");
    CHECK(value(evaluate(settings, "y.npz", ""), "world_mpjpe_mm") < 1e-6);
  }
}

TEST_CASE("motions that begin at other frames are laid on each other where both have begun") {
  const TemporaryFolder here;
  const Motion motion = for_others(true_motion());
  const auto from = [&motion](std::size_t first, double frame_rate) {
    Motion late = resampled(motion, frame_rate);
    late.poses.erase(late.poses.begin(), late.poses.begin() + static_cast<std::ptrdiff_t>(first));
    late.first_frame = static_cast<double>(first);
    return late;
  };
  EvaluationSettings settings;
  settings.avatar = data("avatar.safetensors");
  settings.align = MotionAlign::kRotation;
  settings.truth = "truth.npz";
  const double rate = motion.frame_rate;
  for (const auto& [truth, estimate] :
       {std::pair{from(2, rate), from(0, rate)}, std::pair{from(0, rate), from(2, rate)},
        std::pair{from(1, rate), from(0, 2 * rate)}}) {
    write_motion("truth.npz", truth);
    write_motion("m.npz", transformed(estimate, kElsewhere, kSmplxPelvis));
    CHECK(value(evaluate(settings, "m.npz", ""), "world_mpjpe_mm") < 1e-6);
  }
}

TEST_CASE("rate and up reach the truth where its file leaves them open") {
  const TemporaryFolder here;
  Motion motion = transformed(for_others(true_motion()), kYUp, kSmplxPelvis);
  ForeignFile{motion}.write("m.npz");
  motion.poses.pop_back();
  ForeignFile{motion}.write("truth.npz");
  EvaluationSettings settings;
  settings.truth = "truth.npz";
  settings.avatar = data("avatar.safetensors");
  settings.from_rate = 30;
  for (const std::optional<UpAxis>& up : {std::optional<UpAxis>(), std::optional(UpAxis::kY)}) {
    settings.up = up;
    const Evaluation both = evaluate(settings, "m.npz", "");
    CHECK(both.frame_rate == 30);
    CHECK(both.frames == 3);
    CHECK(value(both, "world_mpjpe_mm") < 1e-6);
    const double height = both.joints[0][static_cast<std::size_t>(3 * smplx_joint("head") + 2)] -
                          both.joints[0][static_cast<std::size_t>(3 * smplx_joint("left_foot") + 2)];
    CHECK(height > 1);
    CHECK_THAT(both.notes.front(), Contains("the truth: y is up"));
  }
  // A truth that says both itself keeps them.
  settings.truth = data();
  settings.from_rate = 10;
  CHECK(value(evaluate(settings, "m.npz", ""), "world_mpjpe_mm") < 1e-6);
}

TEST_CASE("a motion is exported at the rate that it was found to have") {
  const TemporaryFolder here;
  Motion truth = for_others(true_motion());
  truth.frame_rate = 20;
  write_motion("truth.npz", truth);
  ForeignFile{truth, true_objects()}.write("m.npz");
  EvaluationSettings settings;
  settings.truth = "truth.npz";
  settings.avatar = data("avatar.safetensors");
  // Three steps of 1/20 s: at 30 a second four and a half.
  CHECK_THAT(export_for_baselines(settings, "m.npz", "out"), Contains("out: 5 frames at 30 a second"));
  const Npz trajectory = Npz::read("out/trajectory.npz");
  trajectory.array("object/translation").require_shape({5, 3});
  const std::vector<double> pelvis = trajectory.array("pelvis").as<double>();
  const Point third(pelvis.data() + 9), expected = kSmplxPelvis + truth.poses[2].transl;  // at 0.1 s
  CHECK((third - expected).norm() < 1e-9);
}

TEST_CASE("objects of a motion's file move with it, and those of --objects are in the scene") {
  const TemporaryFolder here;
  const Motion motion = for_others(true_motion());
  EvaluationSettings settings;
  settings.truth = data();
  const auto check_is_true = [&settings](const char* file) {
    const Evaluation evaluation = evaluate(settings, file, "");
    for (const char* name : {"world_mpjpe_mm", "object_translation_cm", "object_rotation_deg", "object_add_cm"}) {
      INFO(file << " " << name);
      CHECK(value(evaluation, name) < 1e-4);
    }
  };
  moved(motion, true_objects(), kYUp, kSmplxPelvis).write("y.npz");
  check_is_true("y.npz");
  settings.align = MotionAlign::kHeading;
  moved(motion, true_objects(), kElsewhere, kSmplxPelvis).write("away.npz");
  check_is_true("away.npz");
  moved(motion, true_objects(), compose(kYUp, kElsewhere), kSmplxPelvis).write("both.npz");
  check_is_true("both.npz");
  settings.objects = data("truth/objects.npz");
  for (const char* file : {"y.npz", "away.npz", "both.npz"}) check_is_true(file);
  CHECK_THAT(joined(evaluate(settings, "y.npz", "").notes), Contains("objects.npz are in the scene's world, z up"));
  NpzWriter nothing;
  nothing.add_scalar("fps", 10.0);
  nothing.write("none.npz");
  settings.objects = "none.npz";
  CHECK_THROWS_WITH(evaluate(settings, "y.npz", ""), "none.npz: holds no poses of objects");
}

TEST_CASE("an object is where its file's origin is said to be, by its centroid") {
  const TemporaryFolder here;
  // About the body in every frame; in its own file far from the origin.
  const Point middle(10.5, -3, 7);
  write_mesh("box.ply", box_mesh(middle - Point(2, 3, 2), middle + Point(2, 3, 2)));
  const Motion motion = for_others(true_motion());
  std::vector<std::vector<ObjectPose>> centres, origins;
  for (const BodyPose& pose : motion.poses) {
    const Point turn(0.3, -0.2, 0.9), place = kSmplxPelvis + pose.transl;
    centres.push_back({{turn, place}});
    origins.push_back({{turn, place - so3_exp(turn) * middle}});
  }
  ForeignFile{motion, centres, "obj_com_pos", 10}.write("com.npz");
  ForeignFile{motion, origins, "obj_trans", 10}.write("origin.npz");
  EvaluationSettings settings;
  settings.avatar = data("avatar.safetensors");
  const Evaluation unknown = evaluate(settings, "origin.npz", "");
  CHECK_THAT(joined(unknown.notes), Contains("--object-surface object=F says where it is"));
  CHECK(find_metric(unknown.values, "object_penetration_share") == nullptr);
  settings.object_surfaces = {{"object", "box.ply"}};
  for (const char* file : {"com.npz", "origin.npz"}) {
    INFO(file);
    const Evaluation inside = evaluate(settings, file, "");
    CHECK(inside.has_objects);
    CHECK(value(inside, "object_penetration_share") == 1);
    const MotionInScene scene = motion_in_scene(settings, file);
    CHECK((scene.track.object_poses[2][0].translation - centres[2][0].translation).norm() < 1e-9);
  }
}

}  // namespace evaluation_test
