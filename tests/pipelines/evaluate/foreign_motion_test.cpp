#include "pipelines/evaluate/foreign_motion.h"

#include <cmath>
#include <numbers>

#include <catch2/catch.hpp>

#include "body/body_model.h"
#include "body/motion_edit.h"
#include "core/check.h"
#include "core/npz.h"
#include "core/rotation.h"
#include "pipelines/evaluate/tracks.h"
#include "tests/support/temporary_folder.h"

namespace foreign_motion_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;

namespace {

constexpr double kQuarter = std::numbers::pi / 2;

/// Names that a file may have for the same three arrays.
struct Layout {
  const char *trans, *root, *body;
};

/// Two frames of a person who stands, turned by `root`, at (1, 2, 3) and (1.5, 2, 3).
void write_standing(const char* path, const Layout& names, const Vector3<double>& root, bool by_joint = false,
                    const char* rate = "fps") {
  NpzWriter file;
  file.add<float>(names.trans, {2, 3}, {1, 2, 3, 1.5, 2, 3});
  std::vector<double> turns;
  for (int t = 0; t < 2; ++t) turns.insert(turns.end(), root.data(), root.data() + 3);
  file.add<double>(names.root, {2, 3}, turns);
  std::vector<double> body(126, 0.0);
  body[3 * 15] = 0.25;  // the left shoulder of frame 0: joint 16
  if (by_joint) {
    file.add<double>(names.body, {2, 21, 3}, body);
  } else {
    file.add<double>(names.body, {2, 63}, body);
  }
  if (rate[0] != 0) file.add_scalar(rate, 30.0);
  file.write(path);
}

/// On a body whose pelvis is that of SMPL-X, z up.
Track on_body(Track track) {
  track.motion = for_body(track.motion, kSmplxName, kSmplxPelvis);
  turn_z_up(track);
  CHECK(track.up == UpAxis::kZ);
  return track;
}

void check_is_standing(const Track& track, const Vector3<double>& first, const Vector3<double>& second) {
  REQUIRE(track.frames() == 2);
  CHECK(track.motion.poses[0].axis_angle[48] == Approx(0.25));
  for (int t = 0; t < 2; ++t) {
    const BodyPose& pose = track.motion.poses[static_cast<std::size_t>(t)];
    const Vector3<double> up = so3_exp(Vector3<double>(pose.axis_angle.data())) * Vector3<double>(0, 1, 0);
    CHECK((up - Vector3<double>(0, 0, 1)).norm() < 1e-9);
    CHECK((pose.transl + kSmplxPelvis - (t == 0 ? first : second)).norm() < 1e-9);
  }
}

}  // namespace

TEST_CASE("motions by the names of TRUMANS LINGO CHOIS and smplx are read alike") {
  const TemporaryFolder here;
  // y up: the pelvis, at r + t, goes from (x, y, z) to (x, −z, y).
  const Vector3<double> pelvis = kSmplxPelvis + Vector3<double>(1, 2, 3), step(0.5, 0, 0);
  const Vector3<double> turned(pelvis[0], -pelvis[2], pelvis[1]);
  int count = 0;
  for (const Layout& names : {Layout{"transl", "global_orient", "body_pose"},          // results of TRUMANS, LINGO
                              Layout{"human_transl", "human_orient", "human_pose"},    // data of TRUMANS
                              Layout{"transl_aligned", "human_orient", "human_pose"},  // data of LINGO
                              Layout{"trans", "root_orient", "pose_body"}}) {          // CHOIS, OMOMO, AMASS
    write_standing("m.npz", names, Vector3<double>::Zero(), count++ % 2 == 1);
    INFO(names.trans);
    const Track track = on_body(read_track("m.npz"));
    CHECK(track.world == "y is up, by the posture: turned (--up z if it is not)");
    CHECK(track.motion.frame_rate == 30);
    check_is_standing(track, turned, turned + step);
    write_standing("z.npz", names, Vector3<double>(kQuarter, 0, 0));
    const Track level = on_body(read_track("z.npz"));
    CHECK(level.world == "z is up, by the posture");
    check_is_standing(level, pelvis, pelvis + step);
  }
}

TEST_CASE("a motion of WHAM by its own names is one of SMPL with y up") {
  const TemporaryFolder here;
  NpzWriter file;
  file.add<double>("trans_world", {1, 3}, {1, 2, 3});
  file.add<double>("pose_world", {1, 72}, std::vector<double>(72, 0.0));
  file.add<double>("betas", {1, 10}, std::vector<double>(10, 0.0));
  file.write("w.npz");
  const Track track = on_body(read_track("w.npz", {.frame_rate = 25}));
  CHECK(track.motion.converted_from == "SMPL");
  CHECK(track.motion.frame_rate == 25);
  const Vector3<double> pelvis = kSmplPelvis + Vector3<double>(1, 2, 3);
  CHECK((track.motion.poses[0].transl + kSmplxPelvis - Vector3<double>(pelvis[0], -pelvis[2], pelvis[1])).norm() <
        1e-9);
}

TEST_CASE("which way is up can be told, is that of AMASS by its names, and may stay open") {
  const TemporaryFolder here;
  const Layout names{"trans", "root_orient", "pose_body"};
  write_standing("amass.npz", names, Vector3<double>::Zero(), false, "mocap_frame_rate");
  CHECK(read_track("amass.npz").up == UpAxis::kZ);
  CHECK(read_track("amass.npz").world ==
        "z is taken for up, as in files by AMASS's names, but the body stands along y (--up says which)");
  CHECK(read_track("amass.npz", {.upright = Vector3<double>(0, 0, 1)}).world.empty());
  const Track turned = read_track("amass.npz", {.upright = Vector3<double>(0, 1, 0)});
  CHECK(turned.up == UpAxis::kY);
  CHECK(turned.world == "y is up, as the body is in frame 0: turned (--up z if it is not)");
  write_standing("down.npz", names, Vector3<double>(std::numbers::pi, 0, 0), false, "mocap_frame_rate");
  CHECK_THROWS_WITH(read_track("down.npz", {.upright = Vector3<double>(0, 1, 0)}),
                    Contains("down.npz: y points down, by how the body is in frame 0"));
  CHECK(read_track("amass.npz", {.up = UpAxis::kY}).world == "y is up, as --up says: turned");
  write_standing("lying.npz", names, Vector3<double>(0, 0, kQuarter));
  CHECK(read_track("lying.npz").world == "z is taken for up: the posture does not tell (--up y if y is)");
  CHECK(read_track("lying.npz", {.up = UpAxis::kZ}).world.empty());
  write_standing("camera.npz", names, Vector3<double>(std::numbers::pi, 0, 0));
  CHECK_THROWS_WITH(read_track("camera.npz"),
                    "camera.npz: y points down, by the posture, as in a camera's frame; a motion in the world is "
                    "needed (--up z or y says that it is one)");
  CHECK(read_track("camera.npz", {.up = UpAxis::kZ}).frames() == 2);
}

TEST_CASE("how the body begins tells which way is up of who lies") {
  const TemporaryFolder here;
  const Layout names{"trans", "root_orient", "pose_body"};
  // z up, on the back with the head to y; the same root stands with y up.
  write_standing("m.npz", names, Vector3<double>::Zero());
  CHECK(read_track("m.npz").up == UpAxis::kY);
  const Track lying = read_track("m.npz", {.upright = Vector3<double>(0, 0, 1)});
  CHECK(lying.up == UpAxis::kZ);
  CHECK(lying.world == "z is up, as the body is in frame 0");
  const Track standing = read_track("m.npz", {.upright = Vector3<double>(0, 1, 0)});
  CHECK(standing.up == UpAxis::kY);
  CHECK(standing.world == "y is up, as the body is in frame 0: turned (--up z if it is not)");
  // With the head to −y, and a camera's frame.
  write_standing("n.npz", names, Vector3<double>(0, 0, 2 * kQuarter));
  CHECK_THROWS_WITH(read_track("n.npz"), Contains("n.npz: y points down, by the posture"));
  CHECK(read_track("n.npz", {.upright = Vector3<double>(0, 0, 1)}).up == UpAxis::kZ);
  CHECK_THROWS_WITH(read_track("n.npz", {.upright = Vector3<double>(0, 1, 0)}),
                    Contains("n.npz: y points down, by how the body is in frame 0"));
  // Near to no axis: by the posture.
  CHECK(read_track("m.npz", {.upright = Vector3<double>(1, 0, 0)}).world ==
        "y is up, by the posture: turned (--up z if it is not)");
  // Of files that say it themselves, options that fill in say nothing.
  write_standing("amass.npz", names, Vector3<double>::Zero(), false, "mocap_frame_rate");
  CHECK(read_track("amass.npz", {.frame_rate = 5, .up = UpAxis::kY, .fills_in = true}).up == UpAxis::kZ);
  CHECK(read_track("amass.npz", {.frame_rate = 5, .up = UpAxis::kY, .fills_in = true}).motion.frame_rate == 30);
  CHECK(read_track("n.npz", {.up = UpAxis::kY, .fills_in = true}).up == UpAxis::kY);
}

TEST_CASE("obj_trans is the place of the mesh's origin, where nothing says that of its centre") {
  const TemporaryFolder here;
  const auto objects_of = [](std::initializer_list<const char*> names) {
    NpzWriter file;
    file.add<double>("obj_rot", {1, 3, 3}, {1, 0, 0, 0, 1, 0, 0, 0, 1});
    double x = 1;
    for (const char* const name : names) file.add<double>(name, {1, 3, 1}, {x++, 0, 0});
    file.write("o.npz");
    return read_motion_objects("o.npz", "object");
  };
  CHECK(objects_of({"obj_trans"}).are_of_origins);
  const ForeignObjects both = objects_of({"obj_trans", "obj_com_pos"});
  CHECK_FALSE(both.are_of_origins);
  CHECK(both.poses[0][0].translation[0] == 2);
}

TEST_CASE("objects in a motion's file turn with its world") {
  const TemporaryFolder here;
  const auto write = [](const char* path, const std::vector<double>& matrix, std::int64_t frames = 2) {
    NpzWriter file;
    file.add<double>("trans", {2, 3}, {0, 1, 0, 0, 1, 0});
    file.add<double>("root_orient", {2, 3}, std::vector<double>(6, 0.0));
    file.add<double>("pose_body", {2, 63}, std::vector<double>(126, 0.0));
    file.add_scalar("fps", 30.0);
    std::vector<double> matrices, places;
    for (std::int64_t t = 0; t < frames; ++t) {
      matrices.insert(matrices.end(), matrix.begin(), matrix.end());
      places.insert(places.end(), {1, 2, 3});
    }
    file.add<double>("obj_rot_mat", {frames, 3, 3}, matrices);
    file.add<double>("obj_com_pos", {frames, 3, 1}, places);
    file.write(path);
  };
  write("o.npz", {1, 0, 0, 0, 1, 0, 0, 0, 1});
  const Track track = on_body(read_track("o.npz", {.object_name = "vase"}));
  REQUIRE(track.objects == std::vector<std::string>{"vase"});
  REQUIRE(track.object_poses.size() == 2);
  const ObjectPose& pose = track.object_poses[1][0];
  CHECK((pose.translation - Vector3<double>(1, -3, 2)).norm() < 1e-12);
  CHECK((pose.rotation - Vector3<double>(kQuarter, 0, 0)).norm() < 1e-12);
  const Track level = on_body(read_track("o.npz", {.up = UpAxis::kZ}));
  CHECK(level.objects == std::vector<std::string>{"object"});
  CHECK(level.object_poses[0][0].translation == Vector3<double>(1, 2, 3));
  write("m.npz", {1, 0, 0, 0, 1, 0, 0, 0, -1});
  CHECK_THROWS_WITH(read_track("m.npz"), "m.npz: array 'obj_rot_mat': frame 0 is no rotation");
  write("t.npz", {1, 0, 0, 0, 1, 0, 0, 0, 1}, 3);
  CHECK_THROWS_WITH(read_track("t.npz"), "t.npz: holds 3 frames of objects, the motion beside it has 2 frames");
  NpzWriter half;
  half.add<double>("obj_rot", {1, 3, 3}, {1, 0, 0, 0, 1, 0, 0, 0, 1});
  half.write("h.npz");
  CHECK_THROWS_WITH(read_motion_objects("h.npz", "object"), "h.npz: array 'obj_rot': is there without 'obj_com_pos'");
  NpzWriter other;
  other.add<double>("obj_trans", {1, 3}, {1, 0, 0});
  other.write("t.npz");
  CHECK_THROWS_WITH(read_motion_objects("t.npz", "object"), "t.npz: array 'obj_trans': is there without 'obj_rot_mat'");
  NpzWriter ours;
  ours.add<double>("box/rotation", {1, 3}, {0, 0, 1});
  ours.add<double>("box/translation", {1, 3}, {4, 5, 6});
  ours.write("b.npz");
  const ForeignObjects objects = read_motion_objects("b.npz", "object");
  CHECK(objects.names == std::vector<std::string>{"box"});
  CHECK(objects.poses[0][0].translation == Vector3<double>(4, 5, 6));
}

TEST_CASE("objects of a motion have names that files may have") {
  const TemporaryFolder here;
  for (const std::string name : {"../x", "/x", "a/b", "..", ""}) {
    INFO(name);
    NpzWriter file;
    file.add<double>(name + "/rotation", {1, 3}, {0, 0, 0});
    file.add<double>(name + "/translation", {1, 3}, {0, 0, 0});
    file.write("m.npz");
    CHECK_THROWS_WITH(read_motion_objects("m.npz", "object"), Contains("m.npz: has an object called \"" + name + "\""));
  }
}

}  // namespace foreign_motion_test
