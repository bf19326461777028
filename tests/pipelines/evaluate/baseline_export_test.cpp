#include "pipelines/evaluate/baseline_export.h"

#include <cmath>

#include <catch2/catch.hpp>

#include "body/kinematics.h"
#include "body/motion_io.h"
#include "core/npz.h"
#include "core/rotation.h"
#include "tests/support/tiny_run.h"

namespace baseline_export_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

using Point = Vector3<double>;

}  // namespace

TEST_CASE("voxels are those whose centres are in the solid") {
  // A ball about (0.5, -0.25, 1), z up: at (0.5, 1, 0.25) with y up.
  const Point center(0.5, -0.25, 1);
  const auto ball = [&center](const Point& place) { return (place - center).norm() - 0.3; };
  const VoxelBox box{{-1, 0, -1}, {1, 2, 1}, {37, 25, 30}};
  const std::vector<std::uint8_t> voxels = voxels_in(ball, box);
  std::size_t at = 0, occupied = 0;
  for (Index i = 0; i < 37; ++i) {
    for (Index j = 0; j < 25; ++j) {
      for (Index k = 0; k < 30; ++k, ++at) {
        const Point place(-1 + 2 * (static_cast<double>(i) + 0.5) / 37, 2 * (static_cast<double>(j) + 0.5) / 25,
                          -1 + 2 * (static_cast<double>(k) + 0.5) / 30);
        const bool is_in = (place - Point(0.5, 1, 0.25)).norm() < 0.3;
        REQUIRE(voxels[at] == (is_in ? 1 : 0));
        occupied += is_in ? 1 : 0;
      }
    }
  }
  CHECK(occupied > 100);
}

TEST_CASE("what TRUMANS LINGO and CHOIS start from is written", "[release]") {
  const TemporaryFolder here;
  const std::string data = TinyDataset::folder().string();
  EvaluationSettings settings;
  settings.data = data;
  const std::string told = export_for_baselines(settings, data, "out");
  // Four frames at 10 a second are ten at 30.
  CHECK(told == "out: 10 frames at 30 a second, for TRUMANS, LINGO and CHOIS; grids of the mesh " + data +
                    "/truth/surface.ply");
  const Motion truth = read_motion(data + "/truth/motion.npz"), motion = read_motion("out/motion.npz");
  REQUIRE(motion.poses.size() == 10);
  CHECK(motion.frame_rate == 30);
  CHECK(motion.poses[3].axis_angle == truth.poses[1].axis_angle);
  const Avatar avatar = read_avatar(data + "/avatar.safetensors");
  const std::vector<double> first = pose_joints(avatar, truth.poses[0]), last = pose_joints(avatar, truth.poses[3]);

  const Npz trajectory = Npz::read("out/trajectory.npz");
  const std::vector<double> pelvis = trajectory.array("pelvis").require_shape({10, 3}).as<double>();
  for (std::size_t i = 0; i < 3; ++i) CHECK(pelvis[27 + i] == Approx(last[i]).margin(1e-12));
  CHECK(trajectory.array("initial/joints").as<double>() == first);
  CHECK(trajectory.array("initial/body_pose").require_shape({63}).as<double>() ==
        std::vector<double>(truth.poses[0].axis_angle.begin() + 3, truth.poses[0].axis_angle.begin() + 66));
  const auto poses = read_object_tracks(data + "/truth/objects.npz", {kTinyObject});
  const Matrix3<double> turn = so3_exp(poses[0][0].rotation);
  const std::vector<double> rotation = trajectory.array(kTinyObject + "/rotation_matrix").as<double>();
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c)
      CHECK(rotation[static_cast<std::size_t>(3 * r + c)] == Approx(turn(r, c)).margin(1e-12));
  }

  const nlohmann::json trumans = json_of("out/trumans/trajectory.json");
  REQUIRE(trumans.size() == 10);
  CHECK(trumans[9]["x"].get<double>() == Approx(last[0]).margin(1e-12));
  CHECK(trumans[9]["y"] == 0);
  CHECK(trumans[9]["z"].get<double>() == Approx(-last[1]).margin(1e-12));
  const NpyArray grid = read_npy("out/trumans/Scene/scene.npy");
  grid.require_shape({300, 100, 400});
  const std::vector<std::uint8_t> voxels = grid.as<std::uint8_t>();
  const auto occupied = static_cast<std::size_t>(std::count(voxels.begin(), voxels.end(), 1));
  CHECK(occupied > 100);
  CHECK(occupied < voxels.size() / 2);
  read_npy("out/lingo/Scene_vis/scene.npy").require_shape({400, 100, 600});

  const nlohmann::json lingo = json_of("out/lingo/input.json")[0];
  CHECK(lingo["scene_name"] == "scene");
  CHECK(lingo["seg_num"] == 1);
  CHECK(lingo["episode_num"] == 1);
  CHECK(lingo["start_location"][1].get<double>() == Approx(first[2]).margin(1e-12));
  CHECK(lingo["end_location"][2].get<double>() == Approx(-last[1]).margin(1e-12));

  const Npz chois = Npz::read("out/chois/" + kTinyObject + ".npz");
  chois.array("obj_rot_mat").require_shape({10, 3, 3});
  chois.array("betas").require_shape({1, 16});
  const std::vector<double> places = chois.array("obj_com_pos").require_shape({10, 3}).as<double>();
  for (int i = 0; i < 3; ++i)
    CHECK(places[static_cast<std::size_t>(27 + i)] == Approx(poses[3][0].translation[i]).margin(1e-12));
  CHECK(chois.array("waypoint_frames").as<std::int64_t>() == std::vector<std::int64_t>{0, 9});
  CHECK(chois.array("object_points").shape()[1] == 3);

  SECTION("what was written is read again as a motion with its object") {
    settings.truth = data;
    const Evaluation again = evaluate(settings, "out/chois/" + kTinyObject + ".npz", "");
    CHECK(again.frame_rate == 10);
    for (const char* name :
         {"mpjpe_mm", "world_mpjpe_mm", "object_translation_cm", "object_rotation_deg", "object_add_cm"}) {
      INFO(name);
      REQUIRE(find_metric(again.values, name) != nullptr);
      CHECK(*find_metric(again.values, name) < 1e-3);
    }
  }
}

}  // namespace baseline_export_test
