#include "body/motion_edit.h"

#include <cmath>
#include <cstring>
#include <filesystem>
#include <numbers>

#include <catch2/catch.hpp>

#include "body/avatar.h"
#include "body/body_model.h"
#include "body/procedural_body.h"
#include "core/random.h"
#include "core/rotation.h"
#include "tests/support/smplx_reference.h"
#include "tests/support/temporary_folder.h"

namespace motion_edit_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

using Numbers = std::vector<double>;

Motion random_motion(std::size_t frames, std::uint64_t seed, double frame_rate = 30) {
  RandomSequence random(seed);
  Motion motion{frame_rate, {}};
  for (std::size_t t = 0; t < frames; ++t) {
    BodyPose pose = rest_pose(55);
    for (double& x : pose.axis_angle) x = 0.7 * random.normal();
    pose.transl = {random.normal(), random.normal(), random.normal()};
    motion.poses.push_back(pose);
  }
  return motion;
}

bool same_bits(const BodyPose& a, const BodyPose& b) {
  return a.axis_angle.size() == b.axis_angle.size() && a.transl == b.transl &&
         std::memcmp(a.axis_angle.data(), b.axis_angle.data(), a.axis_angle.size() * sizeof(double)) == 0;
}

Matrix3<double> rotation_of(const BodyPose& pose, Index joint) { return so3_exp(pose.rotation_of(joint)); }

double turn_between(const Matrix3<double>& a, const Matrix3<double>& b) {
  return so3_log(Matrix3<double>(a.transpose() * b)).norm();
}

SmplxPose pose_of(const BodyPose& body) {
  SmplxPose pose;
  pose.axis_angle = body.axis_angle;
  pose.transl = {body.transl[0], body.transl[1], body.transl[2]};
  return pose;
}

}  // namespace

TEST_CASE("between two poses joints turn at constant speed along the shorter way") {
  BodyPose a = rest_pose(55), b = a;
  a.transl = {0, 0, 0};
  b.transl = {1, -2, 4};
  a.set_rotation(0, {0, 0, 0.2});
  b.set_rotation(0, {0, 0, 1.2});
  a.set_rotation(3, {3.0, 0, 0});  // by half a turn, not back through zero
  b.set_rotation(3, {-3.0, 0, 0});
  a.set_rotation(4, {0.3, -0.5, 0.9});
  b.set_rotation(4, {-1.3, 0.2, 1.1});
  for (const double u : {0.1, 0.5, 0.8}) {
    const BodyPose m = interpolated(a, b, u);
    CHECK((m.transl - u * b.transl).norm() < 1e-15);
    CHECK(m.rotation_of(0)[2] == Approx(0.2 + u).epsilon(1e-14));
    CHECK(std::abs(m.rotation_of(3)[0]) > 3.0);
    for (const Index j : {3, 4}) {
      const double whole = turn_between(rotation_of(a, j), rotation_of(b, j));
      CHECK(turn_between(rotation_of(a, j), rotation_of(m, j)) == Approx(u * whole).epsilon(1e-12));
      CHECK(turn_between(rotation_of(m, j), rotation_of(b, j)) == Approx((1 - u) * whole).epsilon(1e-12));
    }
  }
  CHECK(same_bits(interpolated(a, b, 0), a));
  CHECK(same_bits(interpolated(a, b, 1), b));
}

TEST_CASE("resampling keeps frames that coincide, bit for bit, and the length") {
  const Motion ten = random_motion(51, 1, 10);
  const Motion thirty = resampled(ten, 30);
  CHECK(thirty.frame_rate == 30);
  REQUIRE(thirty.poses.size() == 151);
  for (std::size_t t = 0; t < 51; ++t) CHECK(same_bits(thirty.poses[3 * t], ten.poses[t]));
  CHECK(same_bits(thirty.poses[1], interpolated(ten.poses[0], ten.poses[1], 10.0 / 30)));
  const Motion back = resampled(thirty, 10);
  REQUIRE(back.poses.size() == 51);
  for (std::size_t t = 0; t < 51; ++t) CHECK(same_bits(back.poses[t], ten.poses[t]));
  CHECK(resampled(random_motion(10, 2, 29.97), 29.97).poses.size() == 10);
  CHECK(resampled(random_motion(1, 3, 10), 30).poses.size() == 1);
  CHECK(resampled(random_motion(10, 4, 30), 7).poses.size() == 3);  // 0, 4.29 and 8.57
  CHECK(resampled(random_motion(100, 5, 120), 30).poses.size() == 25);
  CHECK_THROWS_AS(resampled(ten, 0), InternalError);
  CHECK_THROWS_AS(resampled(Motion{}, 10), InternalError);
}

TEST_CASE("a motion in another world: every vertex and joint moves with the world") {
  const SmplxArrays arrays = random_smplx({.vertices = 40, .seed = 6});
  const SmplxModel model = decode_smplx(smplx_writer(arrays).encode(), "body.npz", {.betas = 0, .expressions = 0});
  const Vector3<double> pelvis(model.joints[0], model.joints[1], model.joints[2]);
  const Motion motion = random_motion(4, 7);
  Rigid<double> other = z_up_from_y_up();
  for (const bool is_general : {false, true}) {
    if (is_general) {
      other.rotation = so3_exp(Vector3<double>(1.1, -2, 0.4));
      other.translation = {3, -1, 0.5};
    }
    const Motion moved = transformed(motion, other, pelvis);
    for (std::size_t t = 0; t < 4; ++t) {
      const SmplxResult before = reference_smplx(arrays, pose_of(motion.poses[t]));
      const SmplxResult after = reference_smplx(arrays, pose_of(moved.poses[t]));
      for (const auto& [from, to] : {std::pair{&before.vertices, &after.vertices}, {&before.joints, &after.joints}}) {
        for (std::size_t i = 0; i < from->size(); i += 3) {
          const Vector3<double> x((*from)[i], (*from)[i + 1], (*from)[i + 2]), y((*to)[i], (*to)[i + 1], (*to)[i + 2]);
          REQUIRE((transform_point(other, x) - y).norm() < 1e-12);
        }
      }
    }
  }
  CHECK((z_up_from_y_up().rotation * Vector3<double>(1, 2, 3) - Vector3<double>(1, -3, 2)).norm() == 0);
  CHECK_THROWS_AS(transformed(motion, std::vector<Rigid<double>>(3), pelvis), InternalError);
}

TEST_CASE("a body with another pelvis: the pelvis stays where it was") {
  const Motion motion = random_motion(3, 8);
  const Motion moved = with_pelvis(motion, kSmplPelvis, kSmplxPelvis);
  for (std::size_t t = 0; t < 3; ++t) {
    CHECK((motion.poses[t].transl + kSmplPelvis - moved.poses[t].transl - kSmplxPelvis).norm() < 1e-15);
    CHECK(moved.poses[t].axis_angle == motion.poses[t].axis_angle);
  }
  CHECK(*moved.pelvis_rest == kSmplxPelvis);
}

TEST_CASE("a motion is moved to the body that it is used on") {
  BodyModel body = procedural_body();
  REQUIRE(body.name == kProceduralName);
  const Vector3<double> pelvis = pelvis_of(body.joints);
  REQUIRE((pelvis - kSmplxPelvis).norm() > 0.01);
  Motion motion = random_motion(3, 10);
  const auto check_pelvis = [&](const Motion& moved, const Vector3<double>& rest) {
    for (std::size_t t = 0; t < 3; ++t) {
      // Where the chain of joints has it.
      const Vector3<double> there = pelvis_of(pose_joints(body, moved.poses[t]));
      CHECK((there - (motion.poses[t].transl + rest)).norm() < 1e-14);
    }
  };
  SECTION("of SMPL-X, on the program's body") { check_pelvis(for_body(motion, body), kSmplxPelvis); }
  SECTION("of SMPL-X in some shape, on a body of SMPL-X: translations stay") {
    body.name = kSmplxName;
    const Motion moved = for_body(motion, body);
    for (std::size_t t = 0; t < 3; ++t) CHECK(same_bits(moved.poses[t], motion.poses[t]));
    CHECK(*moved.pelvis_rest == pelvis);
    check_pelvis(moved, pelvis);
  }
  SECTION("whose pelvis is known, on any body") {
    motion.pelvis_rest = {0.25, -0.125, 0.5};
    for (const char* name : {kSmplxName, kProceduralName, ""}) {
      body.name = name;
      check_pelvis(for_body(motion, body), *motion.pelvis_rest);
    }
  }
  SECTION("of this body: every bit stays") {
    motion.pelvis_rest = pelvis;
    for (std::size_t t = 0; t < 3; ++t) CHECK(same_bits(for_body(motion, body).poses[t], motion.poses[t]));
  }
  SECTION("on an avatar, which knows its body, in a file too") {
    const Avatar avatar = surface_avatar(body, {.gaussians = 50});
    check_pelvis(for_body(motion, avatar), kSmplxPelvis);
    const Avatar read = avatar_of(Safetensors::decode(avatar_file(avatar).encode(), "a"));
    CHECK(read.body == kProceduralName);
    check_pelvis(for_body(motion, read), kSmplxPelvis);
    BodyModel shaped = rest_body(procedural_smplx(2), std::vector<double>{1, 1});
    CHECK(shaped.name == kProceduralName);
  }
}

TEST_CASE("a motion is not resampled into more frames than fit") {
  const Motion slow = random_motion(2, 11, 0.01);
  CHECK(resampled(slow, 1000).poses.size() == 100001);
  CHECK_THROWS_WITH(
      resampled(slow, 1e5),
      "a motion of 2 frames, 0.01 a second, has 10000000 frames at 100000 a second; allowed: at most 1000000");
  CHECK_THROWS_AS(resampled(random_motion(2, 12, 1e-9), 30), UserError);
}

TEST_CASE("hands relative to the model's mean become whole") {
  SmplxModel model;
  model.hands[0].mean = Numbers(45, 0.25);
  model.hands[1].mean = Numbers(45, -0.5);
  const Motion motion = random_motion(2, 9), whole = with_hand_means(motion, model);
  for (std::size_t i = 0; i < 165; ++i) {
    const double added = i < 75 ? 0 : i < 120 ? 0.25 : -0.5;
    CHECK(whole.poses[1].axis_angle[i] == motion.poses[1].axis_angle[i] + added);
  }
}

namespace {

/// A file as SMPLer-X writes it: tables of joints, one frame.
void write_smplerx(const std::string& path, double value, std::int64_t betas = 10, std::int64_t frames = 1) {
  NpzWriter file;
  file.add<float>("global_orient", {1, 3}, {static_cast<float>(value), 0, 0});
  file.add<float>("body_pose", {21, 3}, std::vector<float>(63, 0.5F));
  file.add<float>("left_hand_pose", {15, 3}, std::vector<float>(45, 0.25F));
  file.add<float>("right_hand_pose", {15, 3}, std::vector<float>(45, -0.25F));
  file.add<float>("jaw_pose", {1, 3}, {0.125F, 0, 0});
  file.add<double>("leye_pose", {1, 3}, Numbers(3));
  file.add<double>("reye_pose", {1, 3}, Numbers(3));
  file.add<double>("betas", {1, betas}, Numbers(static_cast<std::size_t>(betas), value));
  file.add<float>("expression", {1, 10}, std::vector<float>(10, 0.0F));
  Numbers transl(static_cast<std::size_t>(3 * frames));
  transl[1] = value;
  file.add<double>("transl", {frames, 3}, transl);
  file.write(path);
}

}  // namespace

TEST_CASE("a folder of SMPLer-X files is a motion, and frames without a file are filled") {
  const TemporaryFolder folder;
  std::filesystem::create_directory("smplx");
  write_smplerx("smplx/00008_0.npz", 0.5);
  write_smplerx("smplx/00009_0.npz", 0.75);
  write_smplerx("smplx/00012_0.npz", 1.5);
  write_smplerx("smplx/00009_1.npz", 9);
  folder.write("smplx/notes.txt", "");
  folder.write("smplx/._00009_0.npz", "left by another system");
  const PoseFolder read = read_pose_folder("smplx", 30);
  CHECK(read.files == 3);
  CHECK(read.filled == 2);
  REQUIRE(read.motion.poses.size() == 5);
  CHECK(read.motion.frame_rate == 30);
  CHECK(read.motion.betas[9] == Approx((0.5 + 0.75 + 1.5) / 3).epsilon(1e-14));
  const double expected[] = {0.5, 0.75, 1, 1.25, 1.5};
  for (std::size_t t = 0; t < 5; ++t) {
    const BodyPose& pose = read.motion.poses[t];
    CHECK(pose.rotation_of(0)[0] == Approx(expected[t]).epsilon(1e-14));
    CHECK(pose.transl[1] == Approx(expected[t]).epsilon(1e-14));
    CHECK(pose.rotation_of(21)[2] == 0.5);
    CHECK(pose.rotation_of(22)[0] == 0.125);
    CHECK(pose.rotation_of(25)[0] == 0.25);
    CHECK(pose.rotation_of(54)[2] == -0.25);
  }
  CHECK(read.motion.first_frame == 8);
  CHECK_FALSE(read.counts_from_one);
  CHECK(read.other_people == std::set<std::int64_t>{1});
  CHECK(read_pose_folder("smplx", 30, 1).motion.poses.size() == 1);
  CHECK(read_pose_folder("smplx", 30, 1).motion.first_frame == 9);
  CHECK(resampled(read.motion, 15).first_frame == 4);
  std::filesystem::create_directory("from_one");
  write_smplerx("from_one/00001_0.npz", 0.5);
  CHECK(read_pose_folder("from_one", 30).motion.first_frame == 0);
  CHECK(read_pose_folder("from_one", 30).counts_from_one);
  write_smplerx("from_one/00005_1.npz", 0.5);  // who comes later counts as the first one does
  CHECK(read_pose_folder("from_one", 30, 1).motion.first_frame == 4);
}

TEST_CASE("faults of folders are named") {
  const TemporaryFolder folder;
  CHECK_THROWS_WITH(read_pose_folder("none", 30), Catch::StartsWith("none: cannot be read as a folder: "));
  std::filesystem::create_directory("a");
  CHECK_THROWS_WITH(read_pose_folder("a", 30), "a: holds no file FRAME.npz or FRAME_PERSON.npz of person 0");
  write_smplerx("a/1.npz", 0);
  write_smplerx("a/2.npz", 0, 11);
  CHECK_THROWS_WITH(read_pose_folder("a", 30), "a/2.npz: has 11 betas; the files before it have 10");
  NpzWriter other;
  other.add<double>("betas", {10}, Numbers(10));
  other.add<double>("transl", {3}, Numbers(3));
  other.add<double>("global_orient", {3}, Numbers(3));
  other.write("a/2.npz");
  CHECK_THROWS_WITH(read_pose_folder("a", 30), "a/2.npz: has no array 'body_pose', which every file of SMPLer-X has");
  write_smplerx("a/2.npz", 0, 10, 2);
  CHECK_THROWS_WITH(read_pose_folder("a", 30), "a/2.npz: has 2 frames; a file of a folder has one");
  std::filesystem::remove("a/2.npz");
  write_smplerx("a/01.npz", 0);
  CHECK_THROWS_WITH(read_pose_folder("a", 30), "a/1.npz: is of frame 1, as is a/01.npz");
  std::filesystem::remove("a/01.npz");
  write_smplerx("a/900000000000.npz", 0);
  CHECK_THROWS_WITH(read_pose_folder("a", 30),
                    "a/900000000000.npz: is of frame 900000000000, the one before it of "
                    "frame 1; allowed: 1000 frames later");
  NpzWriter pca;
  pca.add<double>("left_hand_pose", {1, 6}, Numbers(6));
  CHECK_THROWS_WITH(motion_of(decode_smplx_sequence(pca.encode(), "p.npz"), 30),
                    "p.npz: array 'left_hand_pose': has 6 numbers a frame; of a motion's hand 45 are needed");
}

}  // namespace motion_edit_test
