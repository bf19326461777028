#include "pipelines/cli/pose_command.h"

#include <cmath>

#include <catch2/catch.hpp>

#include "core/npz.h"
#include "tests/support/measures.h"
#include "tests/support/program.h"
#include "tests/support/smplx_reference.h"

namespace pose_command_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;

namespace {

using Numbers = std::vector<double>;

/// Parameters of one frame; hands are what the body adds to their mean.
NpzWriter params_of(const SmplxPose& pose) {
  NpzWriter file;
  const auto add = [&](const char* name, const Numbers& numbers) {
    file.add<double>(name, {1, static_cast<std::int64_t>(numbers.size())}, numbers);
  };
  const auto part = [&](std::ptrdiff_t first, std::ptrdiff_t count) {
    const auto begin = pose.axis_angle.begin() + first;
    return Numbers(begin, begin + count);
  };
  add("betas", pose.betas);
  add("expression", pose.expression);
  add("global_orient", part(0, 3));
  add("body_pose", part(3, 63));
  add("jaw_pose", part(66, 3));
  add("leye_pose", part(69, 3));
  add("reye_pose", part(72, 3));
  add("left_hand_pose", part(75, 45));
  add("right_hand_pose", part(120, 45));
  add("transl", {pose.transl.begin(), pose.transl.end()});
  return file;
}

}  // namespace

TEST_CASE("pose writes vertices and joints in the precision asked for") {
  const TemporaryFolder folder;
  const SmplxArrays arrays = random_smplx({.vertices = 40, .seed = 70});
  smplx_writer(arrays).write("m.npz");
  const SmplxPose pose = random_smplx_pose(10, 10, 71);
  params_of(pose).write("p.npz");
  const SmplxResult expected = reference_smplx(arrays, pose);
  for (const bool is_double : {false, true}) {
    std::vector<std::string> arguments = {"pose",  "--body-model", "m.npz",   "--params",
                                          "p.npz", "--out",        "out.npz", "--flat-hand-mean"};
    if (is_double) arguments.insert(arguments.end(), {"--precision", "double"});
    const ProgramResult result = run_hsi4d(arguments);
    CHECK(result.err.empty());
    CHECK(result.out == "out.npz: 1 frame of 40 vertices and 55 joints\n");
    const Npz out = Npz::read("out.npz");
    CHECK(out.array("vertices").dtype() == (is_double ? "<f8" : "<f4"));
    const double bound = is_double ? 1e-9 : 1e-5;
    CHECK(largest_difference(out.array("vertices").require_shape({1, 40, 3}).as<double>(), expected.vertices) <= bound);
    CHECK(largest_difference(out.array("joints").require_shape({1, 55, 3}).as<double>(), expected.joints) <= bound);
  }
}

TEST_CASE("pose tells what is wrong with its options and files") {
  const TemporaryFolder folder;
  smplx_writer(random_smplx({.vertices = 10, .columns = 12, .seed = 72})).write("m.npz");
  NpzWriter good, extra;
  good.add<double>("transl", {1, 3}, Numbers(3));
  good.write("p.npz");
  extra.add<double>("transl", {1, 3}, Numbers(3));
  extra.add<double>("vertices", {1}, Numbers(1));
  extra.write("extra.npz");
  const auto error = [](const std::vector<std::string>& more, const std::string& params = "p.npz",
                        const std::string& out = "o.npz") {
    std::vector<std::string> all = {"pose", "--body-model", "m.npz", "--params", params, "--out", out};
    all.insert(all.end(), more.begin(), more.end());
    const ProgramResult result = run_hsi4d(all);
    CHECK(result.status == 2);
    return result.err;
  };
  CHECK(error({"--precision", "reference"}) ==
        "hsi4d pose: --precision: \"reference\" is not known; allowed: float, double\n");
  CHECK(error({"--hands", "fll"}) ==
        "hsi4d pose: --hands: \"fll\" is not known; allowed: auto, full, pca; did you mean \"full\"?\n");
  CHECK_THAT(error({}, "none.npz"), Contains("none.npz"));
  CHECK_THAT(error({}, "p.npz", "o.txt"), Contains("hsi4d pose: --out") && Contains(".npz"));
  CHECK_THAT(error({}, "p.npz", "p.npz"), Contains("hsi4d pose: --out"));
  const ProgramResult warned = run_hsi4d({"pose", "--body-model", "m.npz", "--params", "extra.npz", "--out", "o.npz"});
  CHECK(warned.status == 0);
  CHECK(warned.err == "hsi4d: warning: extra.npz: passed over, no parameters: vertices\n");
}

TEST_CASE("pose leaves out numbers of shape and expression that the model has not, and says so unless they are 0") {
  const TemporaryFolder folder;
  smplx_writer(random_smplx({.vertices = 10, .columns = 12, .seed = 72})).write("m.npz");  // 10 and 2
  const auto posed = [](Numbers betas, Numbers expression, std::string& warnings) {
    NpzWriter file;
    file.add<double>("betas", {1, std::ssize(betas)}, betas);
    file.add<double>("expression", {std::ssize(expression)}, expression);
    file.write("p.npz");
    const ProgramResult result = run_hsi4d({"pose", "--body-model", "m.npz", "--params", "p.npz", "--out", "o.npz"});
    CHECK(result.status == 0);
    warnings = result.err;
    return Npz::read("o.npz").array("vertices").as<double>();
  };
  std::string warnings;
  const Numbers ten(10, 0.5);
  Numbers sixteen = ten;
  sixteen.resize(16);
  const Numbers expected = posed(ten, {1, 2}, warnings);
  CHECK(warnings.empty());
  CHECK(posed(sixteen, {1, 2, 0}, warnings) == expected);
  CHECK(warnings.empty());
  sixteen[12] = 3;
  CHECK(posed(sixteen, {1, 2, 0.5}, warnings) == expected);
  CHECK(warnings ==
        "hsi4d: warning: p.npz: array 'betas': has 16 numbers a frame; m.npz has 10, and the others are left out\n"
        "hsi4d: warning: p.npz: array 'expression': has 3 numbers a frame; m.npz has 2, and the others are left out\n");
}

}  // namespace pose_command_test
