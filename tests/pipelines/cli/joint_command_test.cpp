// `hsi4d joint` as a user runs it.
#include <catch2/catch.hpp>

#include "core/json_text.h"
#include "pipelines/input/object_joint.h"
#include "splat/files/splat_file.h"
#include "tests/support/program.h"
#include "tests/support/small_clip.h"

namespace joint_command_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;

namespace {

/// A drawer of a box that turns, and poses of both.
void write_files() {
  write_splats("drawer.ply", random_gaussians(30, {0, 0, 0}, 0.2, -3, 4));
  ObjectJoint joint = object_joint({JointType::kSlide, "", {0, 2, 0}, {}, {}}, {});
  joint.rest.translation = {0, 0.5, 0.1};
  std::vector<SceneState> frames(6);
  for (std::size_t t = 0; t < frames.size(); ++t) {
    const auto step = static_cast<double>(t);
    const ObjectPose box{{0, 0, 0.1 * step}, {0.2 * step, 0, 0}};
    frames[t].objects = {box, pose_of(compose(rigid_of(box), on_joint(joint, 0.05 * step)))};
  }
  write_object_tracks("objects.npz", {"box", "drawer"}, frames);
}

}  // namespace

TEST_CASE("hsi4d joint tells the joint of an object as a config names it") {
  const TemporaryFolder folder;
  write_files();
  const ProgramResult run =
      run_hsi4d({"joint", "objects.npz", "drawer", "--gaussians", "drawer.ply", "--type", "slide", "--parent", "box"});
  CAPTURE(run.err);
  REQUIRE(run.status == 0);
  const ConfigValue section = parse_json_text(run.out.substr(0, run.out.find('\n')), "out");
  CHECK(string_member(section, "type") == "slide");
  CHECK(string_member(section, "parent") == "box");
  CHECK(find_member(section, "origin") == nullptr);
  CHECK(number_of(find_member(section, "axis")->items[1], "") == Approx(1));
  CHECK_THAT(run.out, Contains("drawer slides from 0 to 250 mm; its points are "));
  CHECK_THAT(run.out, Contains("; for data.objects.drawer.joint\n"));
}

TEST_CASE("hsi4d joint names what it cannot use") {
  const TemporaryFolder folder;
  write_files();
  const auto fault = [](const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {"joint", "objects.npz", "drawer", "--gaussians", "drawer.ply"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const ProgramResult run = run_hsi4d(arguments);
    CHECK(run.status == 2);
    return run.err;
  };
  CHECK_THAT(fault({"--type", "ball"}), Contains("hsi4d joint: --type: \"ball\""));
  CHECK_THAT(fault({"--parent", "drawer"}), Contains("--parent: an object does not hang on itself"));
  CHECK_THAT(fault({"--parent", "table"}), Contains("table/rotation"));
  CHECK_THAT(fault({"--parent", "box"}), Contains("the object turns by less than 5 degrees, which tells no axis"));
}

}  // namespace joint_command_test
