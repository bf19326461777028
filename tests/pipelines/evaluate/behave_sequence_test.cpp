#include "pipelines/evaluate/behave_sequence.h"

#include <cmath>
#include <stdexcept>

#include <catch2/catch.hpp>

#include "body/pose_layout.h"
#include "core/check.h"
#include "core/npz.h"
#include "core/rotation.h"
#include "core/text.h"
#include "pipelines/evaluate/evaluation.h"
#include "splat/files/splat_file.h"
#include "tests/optim/solid/meshes.h"
#include "tests/support/tiny_run.h"

namespace behave_sequence_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;

namespace {

using Texts = std::vector<std::string>;

/// Who stands upright in a camera's frame, 3 m before it, and moves 0.1 m to the right a frame.
void write_human(const Texts& times) {
  NpzWriter file;
  const auto frames = std::ssize(times);
  std::vector<float> poses(static_cast<std::size_t>(156 * frames)), trans;
  for (std::int64_t t = 0; t < frames; ++t) {
    poses[static_cast<std::size_t>(156 * t)] = 3.14159265F;  // about x: the head is towards −y
    trans.insert(trans.end(), {0.1F * static_cast<float>(t), 0.25F, 3});
  }
  file.add<float>("poses", {frames, 156}, poses);
  file.add<float>("trans", {frames, 3}, trans);
  file.add<float>("betas", {frames, 10}, std::vector<float>(static_cast<std::size_t>(10 * frames), 0.5F));
  file.add_text("gender", "male");
  file.add_texts("frame_times", times);
  file.write("seq/smpl_fit_all.npz");
}

/// @param far  metres before the camera
void write_object(const Texts& times, double far = 2) {
  NpzWriter file;
  const auto frames = std::ssize(times);
  std::vector<double> angles, trans;
  for (std::int64_t t = 0; t < frames; ++t) {
    angles.insert(angles.end(), {0, 0.1 * static_cast<double>(t), 0});
    trans.insert(trans.end(), {0.2 * static_cast<double>(t), -0.5, far});
  }
  file.add<double>("angles", {frames, 3}, angles);
  file.add<double>("trans", {frames, 3}, trans);
  file.add_texts("frame_times", times);
  file.write("seq/object_fit_all.npz");
}

std::string refused() {
  try {
    read_behave_sequence("seq", "chair");
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "";
}

const Texts kTimes = {"t0003.000", "t0003.033", "t0003.067", "t0003.100"};

}  // namespace

TEST_CASE("a sequence of BEHAVE is read with its object, z up") {
  const TemporaryFolder here;
  write_human(kTimes);
  write_object(kTimes);
  CHECK(is_behave_sequence("seq"));
  CHECK_FALSE(is_behave_sequence("."));
  const Track track = read_track("seq", {.object_name = "chair"});
  CHECK(track.frames() == 4);
  CHECK(track.motion.frame_rate == 30);
  CHECK(track.objects == Texts{"chair"});
  CHECK(track.good_frames == std::vector<bool>(4, true));
  CHECK(track.up == UpAxis::kZ);
  const BodyPose& pose = track.motion.poses[2];
  // The pelvis of SMPL-H is where the file has it: its rest place, moved by trans, right, before, and up.
  const Vector3<double> there = kSmplxPelvis + pose.transl,
                        wanted(kSmplhPelvis[0] + 0.2, kSmplhPelvis[2] + 3, -(kSmplhPelvis[1] + 0.25));
  CHECK((there - wanted).norm() < 1e-6);
  const Vector3<double> up = so3_exp(pose.rotation_of(0)) * Vector3<double>(0, 1, 0);
  CHECK((up - Vector3<double>(0, 0, 1)).norm() < 1e-6);
  const ObjectPose& object = track.object_poses[3][0];
  CHECK((object.translation - Vector3<double>(0.6, 2, 0.5)).norm() < 1e-12);
  // About the camera's y, which is −z, by 0.3, of an object that is turned as the world is.
  const Vector3<double> forward = so3_exp(object.rotation) * Vector3<double>(0, 0, 1);
  CHECK((forward - Vector3<double>(std::sin(0.3), std::cos(0.3), 0)).norm() < 1e-12);
}

TEST_CASE("frames that one of the files leaves out are interpolated and not good") {
  const TemporaryFolder here;
  write_human({"t0003.000", "t0003.033", "t0003.067", "t0003.133"});
  write_object({"t0002.967", "t0003.000", "t0003.067", "t0003.100", "t0003.133"});
  const Track track = read_behave_sequence("seq", "chair");
  CHECK(track.good_frames == std::vector<bool>{true, false, true, false, true});
  const auto right = [&track](std::size_t t) {
    return kSmplxPelvis[0] + track.motion.poses[t].transl[0] - kSmplhPelvis[0];
  };
  CHECK(right(1) == Approx(0.1).margin(1e-6));  // half of the way from the first row to the third
  CHECK(right(3) == Approx(0.25).margin(1e-6));
  CHECK(track.object_poses[3][0].translation[0] == Approx(0.6).margin(1e-12));  // of rows 2 and 4
  CHECK_THAT(track.world, Contains("2 frames that it leaves out are interpolated"));
  std::filesystem::remove("seq/object_fit_all.npz");
  const Track alone = read_behave_sequence("seq", "chair");
  CHECK(alone.objects.empty());
  CHECK(alone.object_poses.empty());
  CHECK(alone.good_frames == std::vector<bool>{true, true, true, false, true});
}

TEST_CASE("a sequence of BEHAVE is the truth of a motion with an object") {
  const TemporaryFolder here;
  write_human(kTimes);
  write_object(kTimes);
  write_mesh("can.ply", box_mesh({-0.3, 0, 0}, {0.1, 0.4, 0.2}));
  const Vector3<double> middle(-0.1, 0.2, 0.1);
  const Track track = read_behave_sequence("seq", kTinyObject);
  // The estimate is the same; its object's poses act about the centroid of the Gaussians.
  EvaluationSettings settings;
  settings.data = TinyDataset::folder().string();
  settings.truth = "seq";
  const Gaussians can = read_splats(object_file_of_track(settings.data, kTinyObject)).gaussians;
  Vector3<double> centroid = can.origin_world;
  for (Index g = 0; g < can.count(); ++g)
    centroid += Vector3<float>(can.means.data() + 3 * g).cast<double>() / static_cast<double>(can.count());
  write_motion("m.npz", track.motion);
  NpzWriter objects;
  std::vector<double> turns, places;
  for (const std::vector<ObjectPose>& poses : track.object_poses) {
    const Vector3<double> place = poses[0].translation + so3_exp(poses[0].rotation) * (centroid - middle);
    turns.insert(turns.end(), poses[0].rotation.data(), poses[0].rotation.data() + 3);
    places.insert(places.end(), place.data(), place.data() + 3);
  }
  objects.add<double>(kTinyObject + "/rotation", {4, 3}, turns);
  objects.add<double>(kTinyObject + "/translation", {4, 3}, places);
  objects.write("objects.npz");
  settings.objects = "objects.npz";
  settings.protocol = Protocol::kBehave;
  const auto value = [](const Evaluation& evaluation, const char* name) {
    const double* const found = find_metric(evaluation.values, name);
    REQUIRE(found != nullptr);
    return *found;
  };
  const Evaluation apart = evaluate(settings, "m.npz", "");
  CHECK(value(apart, "object_translation_cm") == Approx(100 * (centroid - middle).norm()));
  CHECK_THAT(joined(apart.notes), Contains("(--object-surface watering_can=F says it)") &&
                                      Contains("the truth: a sequence of BEHAVE, in its camera's frame"));
  settings.object_surfaces = {{kTinyObject, "can.ply"}};
  const Evaluation same = evaluate(settings, "m.npz", "");
  CHECK(value(same, "object_translation_cm") < 1e-6);
  CHECK(value(same, "world_mpjpe_mm") < 1e-3);
  CHECK(value(same, "acceleration_object_cm") < 1e-6);
  CHECK(value(same, "cd_human_cm") < 1e-4);  // the avatar's points as they are
}

TEST_CASE("what is wrong with a sequence of BEHAVE is told") {
  const TemporaryFolder here;
  const std::string human = "seq/smpl_fit_all.npz: array 'frame_times'";
  write_human({"t0003.000", "0003.033", "t0003.067", "t0003.100"});
  CHECK(refused() == human + ": holds \"0003.033\"; allowed: times like t0012.033");
  for (const char* const text : {"t", "t-1", "tnan", "t1e3", "t3.0s", "t999999999", ""}) {
    write_human({"t0003.000", text});
    INFO(text);
    CHECK_THAT(refused(), Contains("allowed: times like t0012.033"));
  }
  write_human({"t0003.000", "t0003.067", "t0003.033"});
  CHECK(refused() == human + ": \"t0003.033\" follows \"t0003.067\"; allowed: later times, 1/30 s apart at least");
  write_human({"t0003.000", "t0003.010"});
  CHECK_THAT(refused(), Contains("\"t0003.010\" follows \"t0003.000\""));
  write_human({"t0003.000", "t0103.000"});
  CHECK(refused() == "seq/smpl_fit_all.npz: 2999 frames in a row are missing after frame 90; allowed: 999");
  write_human(kTimes);
  write_object({"t0004.000"});
  CHECK(refused() == "seq/object_fit_all.npz: has no frame_times in common with smpl_fit_all.npz");
  write_object(kTimes, std::nan(""));
  CHECK(refused() == "seq/object_fit_all.npz: array 'trans': frame 0 has a number that is not finite, or beyond 1e7");
  NpzWriter file;
  file.add<double>("angles", {2, 3}, {0, 0, 0, 0, 0, 0});
  file.add<double>("trans", {3}, {0, 0, 0});
  file.write("seq/object_fit_all.npz");
  CHECK(refused() == "seq/object_fit_all.npz: array 'trans': has shape [3]; [2,3] is needed");
  NpzWriter untimed;
  untimed.add<double>("angles", {1, 3}, {0, 0, 0});
  untimed.add<double>("trans", {1, 3}, {0, 0, 0});
  untimed.write("seq/object_fit_all.npz");
  CHECK_THAT(refused(), Contains("seq/object_fit_all.npz: has no array 'frame_times'"));
}

}  // namespace behave_sequence_test
