#include "pipelines/cli/motion_command.h"

#include <catch2/catch.hpp>

#include "body/motion_edit.h"
#include "core/npz.h"
#include "tests/support/program.h"
#include "tests/support/smplx_reference.h"

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

}  // namespace

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
  CHECK(run_hsi4d({"motion", "in.npz", "out.npz", "--y-up", "--body-model", "m.npz"}).status == 0);
  const SmplxModel model = read_smplx("m.npz");
  const BodyModel body = rest_body(model, std::span(motion.betas).first(10));
  const Motion expected =
      transformed(motion, z_up_from_y_up(), Vector3<double>(body.joints[0], body.joints[1], body.joints[2]));
  CHECK(read_motion("out.npz").poses[3].transl == expected.poses[3].transl);
  CHECK(run_hsi4d({"motion", "in.npz", "out.glb", "--body-model", "m.npz"}).status == 0);
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
        "hsi4d motion: --frame-rate: 0 is out of range; allowed: above 0\n");
  CHECK_THAT(error({"in.npz", "out.bvh"}), Contains("hsi4d motion: OUT") && Contains(".npz, .glb"));
  CHECK_THAT(error({"in.npz", "in.npz"}), Contains("hsi4d motion: OUT"));
  CHECK_THAT(error({"none.npz", "out.npz"}), Contains("none.npz"));
}
