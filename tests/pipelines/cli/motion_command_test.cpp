#include "pipelines/cli/motion_command.h"

#include <cstring>
#include <filesystem>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "body/motion_edit.h"
#include "body/procedural_body.h"
#include "core/npz.h"
#include "tests/support/program.h"
#include "tests/support/smplx_reference.h"

namespace motion_command_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;

namespace {

Motion some_motion() {
  Motion motion{10, {}};
  for (int t = 0; t < 5; ++t) {
    BodyPose pose = rest_pose(55);
    pose.set_rotation(0, {0.1 * t, 0.2, 0});
    pose.transl = {0.5 * t, 1, 0};
    motion.poses.push_back(pose);
  }
  return motion;
}

/// A motion of SMPL-H in two frames, which are some_motion's first.
void write_smplh(const std::string& path, const std::vector<double>& betas, bool says_rate = true) {
  const Motion motion = some_motion();
  std::vector<double> trans, poses;
  for (std::size_t t = 0; t < 2; ++t) {
    trans.insert(trans.end(), motion.poses[t].transl.data(), motion.poses[t].transl.data() + 3);
    poses.insert(poses.end(), motion.poses[t].axis_angle.begin(), motion.poses[t].axis_angle.begin() + 156);
  }
  NpzWriter file;
  file.add<double>("trans", {2, 3}, trans);
  file.add<double>("poses", {2, 156}, poses);
  file.add<double>("betas", {static_cast<std::int64_t>(betas.size())}, betas);
  if (says_rate) file.add_scalar("mocap_framerate", 10.0);
  file.write(path);
}

/// Where the pelvis of a GLB file is in frame t, in the world with z up.
Vector3<double> pelvis_in_glb(const std::string& path, std::size_t frame) {
  const std::string bytes = file_text(path);
  const auto number_at = [&](std::size_t at) {
    std::uint32_t number = 0;
    std::memcpy(&number, bytes.data() + at, 4);
    return std::size_t{number};
  };
  const std::size_t json_bytes = number_at(12);
  const auto json = nlohmann::json::parse(bytes.substr(20, json_bytes));
  const auto& animation = json["animations"][0];
  for (const auto& channel : animation["channels"]) {
    if (channel["target"]["path"] != "translation") continue;
    if (json["nodes"][channel["target"]["node"].get<std::size_t>()]["name"] != "pelvis") continue;
    const auto output = animation["samplers"][channel["sampler"].get<std::size_t>()]["output"].get<std::size_t>();
    const auto& accessor = json["accessors"][output];
    const auto& view = json["bufferViews"][accessor["bufferView"].get<std::size_t>()];
    const std::size_t begin = 20 + json_bytes + 8 + view.value("byteOffset", std::size_t{0});
    float x[3];
    std::memcpy(x, bytes.data() + begin + 12 * frame, sizeof(x));
    return Vector3<double>(static_cast<double>(x[0]), static_cast<double>(x[1]), static_cast<double>(x[2]));
  }
  FAIL("the pelvis does not move");
  return {};
}

}  // namespace

TEST_CASE("motion keeps the pelvis where a motion of SMPL-H has it, for every body") {
  const TemporaryFolder folder;
  write_smplh("in.npz", {1, 2});
  const SmplxArrays arrays = random_smplx({.vertices = 30, .seed = 91});
  smplx_writer(arrays).write("m.npz");
  const Vector3<double> model_pelvis = pelvis_of(rest_body(read_smplx("m.npz")).joints);
  const Motion source = some_motion();
  const std::string warning =
      "hsi4d: warning: in.npz: is of SMPL-H, whose betas are no shape of SMPL-X: they are left out\n";
  for (const bool is_y_up : {false, true}) {
    const auto run = [&](std::vector<std::string> arguments) {
      arguments.insert(arguments.begin(), {"motion", "in.npz"});
      if (is_y_up) arguments.push_back("--y-up");
      const ProgramResult result = run_hsi4d(arguments);
      CHECK(result.status == 0);
      CHECK(result.err == warning);
    };
    run({"plain.npz"});
    run({"model.npz", "--body-model", "m.npz"});
    run({"plain.glb"});
    run({"model.glb", "--body-model", "m.npz"});
    const Motion plain = read_motion("plain.npz"), model = read_motion("model.npz");
    CHECK(plain.betas == std::vector<double>(10));
    for (std::size_t t = 0; t < 2; ++t) {
      Vector3<double> there = source.poses[t].transl + kSmplhPelvis;
      if (is_y_up) there = transform_point(z_up_from_y_up(), there);
      CHECK((plain.poses[t].transl + kSmplxPelvis - there).norm() < 1e-14);
      CHECK((model.poses[t].transl + model_pelvis - there).norm() < 1e-14);
      CHECK(*model.pelvis_rest == model_pelvis);
      CHECK((pelvis_in_glb("plain.glb", t) - there).norm() < 1e-6);
      CHECK((pelvis_in_glb("model.glb", t) - there).norm() < 1e-6);
    }
  }
}

TEST_CASE("motion puts SMPL-X on the program's body, and a motion of that body on SMPL-X") {
  const TemporaryFolder folder;
  Motion motion = some_motion();
  motion.betas = {0.5, 1};
  write_motion("in.npz", motion);
  const ProgramResult glb = run_hsi4d({"motion", "in.npz", "out.glb"});
  CHECK(glb.err ==
        "hsi4d: warning: in.npz: its betas are of SMPL-X and do not shape the program's body; --body-model has a body "
        "that they "
        "do\n");
  CHECK((pelvis_in_glb("out.glb", 1) - (motion.poses[1].transl + kSmplxPelvis)).norm() < 1e-6);
  CHECK(run_hsi4d({"motion", "in.npz", "same.npz"}).err.empty());
  CHECK(read_motion("same.npz").poses[1].transl == motion.poses[1].transl);  // of a shape whose pelvis is not known

  motion.betas.clear();
  motion.pelvis_rest = pelvis_of(procedural_body().joints);
  write_motion("own.npz", motion);
  CHECK(run_hsi4d({"motion", "own.npz", "out.npz"}).err.empty());
  const Motion read = read_motion("out.npz");
  CHECK(*read.pelvis_rest == kSmplxPelvis);
  CHECK((read.poses[1].transl + kSmplxPelvis - motion.poses[1].transl - *motion.pelvis_rest).norm() < 1e-14);
  CHECK(run_hsi4d({"motion", "own.npz", "own.glb"}).err.empty());
  CHECK((pelvis_in_glb("own.glb", 1) - (motion.poses[1].transl + *motion.pelvis_rest)).norm() < 1e-6);
}

TEST_CASE("motion warns of a file without a frame rate, unless it is told one") {
  const TemporaryFolder folder;
  write_smplh("in.npz", {}, false);
  CHECK(run_hsi4d({"motion", "in.npz", "out.npz"}).err ==
        "hsi4d: warning: in.npz: says no frame rate and is taken for 10 frames a second; --from-rate gives another\n");
  CHECK(run_hsi4d({"motion", "in.npz", "out.npz", "--from-rate", "120"}).err.empty());
  CHECK(read_motion("out.npz").frame_rate == 120);
}

TEST_CASE("motion warns of what it does not know of hands, and of repaired weights") {
  const TemporaryFolder folder;
  std::filesystem::create_directory("frames");
  NpzWriter file;
  file.add<double>("transl", {1, 3}, std::vector<double>(3));
  file.add<double>("global_orient", {1, 3}, std::vector<double>(3));
  file.add<double>("body_pose", {21, 3}, std::vector<double>(63));
  file.add<double>("left_hand_pose", {15, 3}, std::vector<double>(45, 0.25));
  file.write("frames/0.npz");
  SmplxArrays arrays = random_smplx({.vertices = 30, .seed = 92});
  for (std::size_t j = 0; j < 55; ++j) arrays.weights[j] *= 1.009;
  smplx_writer(arrays).write("m.npz");
  const ProgramResult plain = run_hsi4d({"motion", "frames", "out.npz"});
  CHECK(plain.status == 0);
  CHECK(plain.err ==
        "hsi4d: warning: frames: hands are relative to the mean hands of the body model, which are not known without "
        "--body-model: they are taken as they are\n");
  CHECK(read_motion("out.npz").poses[0].rotation_of(25)[0] == 0.25);
  const ProgramResult model = run_hsi4d({"motion", "frames", "out.npz", "--body-model", "m.npz"});
  const std::string repaired = "hsi4d: warning: m.npz: vertices whose skinning weights are divided by their sum: 1\n";
  CHECK(model.err == repaired);
  CHECK(run_hsi4d({"avatar", "make", "--body-model", "m.npz", "--gaussians", "50", "--out", "a.safetensors"}).err ==
        repaired);
}

TEST_CASE("motion turns, resamples and writes") {
  const TemporaryFolder folder;
  write_motion("in.npz", some_motion());
  const ProgramResult result = run_hsi4d({"motion", "in.npz", "out.npz", "--frame-rate", "30", "--y-up"});
  CHECK(result.err.empty());
  CHECK(result.out == "out.npz: 13 frames, 30 a second\n");
  const Motion expected = resampled(transformed(some_motion(), z_up_from_y_up(), kSmplxPelvis), 30);
  const Motion read = read_motion("out.npz");
  REQUIRE(read.poses.size() == expected.poses.size());
  for (std::size_t t = 0; t < read.poses.size(); ++t) {
    CHECK(read.poses[t].axis_angle == expected.poses[t].axis_angle);
    CHECK(read.poses[t].transl == expected.poses[t].transl);
  }
  const ProgramResult glb = run_hsi4d({"motion", "in.npz", "out.glb", "--from-rate", "25"});
  CHECK(glb.err.empty());
  CHECK(glb.out == "out.glb: 5 frames, 25 a second\n");
  CHECK(file_text("out.glb").starts_with("glTF"));
}

TEST_CASE("motion takes pelvis, hands and shape of a body model") {
  const TemporaryFolder folder;
  const SmplxArrays arrays = random_smplx({.vertices = 30, .seed = 90});
  smplx_writer(arrays).write("m.npz");
  Motion motion = some_motion();
  motion.betas = {0.5, -1, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0};  // more than the file has directions
  write_motion("in.npz", motion);
  const ProgramResult turned = run_hsi4d({"motion", "in.npz", "out.npz", "--y-up", "--body-model", "m.npz"});
  CHECK(turned.status == 0);
  CHECK(turned.err.empty());
  const SmplxModel model = read_smplx("m.npz");
  const BodyModel body = rest_body(model, std::span(motion.betas).first(10));
  const Motion expected =
      transformed(motion, z_up_from_y_up(), Vector3<double>(body.joints[0], body.joints[1], body.joints[2]));
  CHECK(read_motion("out.npz").poses[3].transl == expected.poses[3].transl);
  CHECK(run_hsi4d({"motion", "in.npz", "out.glb", "--body-model", "m.npz"}).status == 0);
  motion.betas[11] = 1;
  write_motion("in.npz", motion);
  CHECK(run_hsi4d({"motion", "in.npz", "out.npz", "--body-model", "m.npz"}).err ==
        "hsi4d: warning: in.npz: array 'betas': has 12 numbers a frame; m.npz has 10, and the others are left out\n");
}

TEST_CASE("motion tells what is wrong") {
  const TemporaryFolder folder;
  write_motion("in.npz", some_motion());
  const auto error = [](const std::vector<std::string>& arguments) {
    std::vector<std::string> all = {"motion"};
    all.insert(all.end(), arguments.begin(), arguments.end());
    const ProgramResult result = run_hsi4d(all);
    CHECK(result.status == 2);
    return result.err;
  };
  CHECK(error({"in.npz", "out.npz", "--frame-rate", "0"}) ==
        "hsi4d motion: --frame-rate: 0 is out of range; allowed: 0.01 to 100000\n");
  CHECK(error({"in.npz", "out.npz", "--from-rate", "0.01", "--frame-rate", "100000"}) ==
        "hsi4d motion: --frame-rate: a motion of 5 frames, 0.01 a second, has 40000000 frames at 100000 a second; "
        "allowed: at most 1000000\n");
  CHECK_THAT(error({"in.npz", "out.bvh"}), Contains("hsi4d motion: OUT") && Contains(".npz, .glb"));
  CHECK_THAT(error({"in.npz", "in.npz"}), Contains("hsi4d motion: OUT"));
  CHECK_THAT(error({"none.npz", "out.npz"}), Contains("none.npz"));
}

}  // namespace motion_command_test
