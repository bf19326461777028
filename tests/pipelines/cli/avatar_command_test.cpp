#include "pipelines/cli/avatar_command.h"

#include <catch2/catch.hpp>

#include "body/avatar.h"
#include "body/avatar_shape.h"
#include "body/procedural_body.h"
#include "core/check.h"
#include "core/file.h"
#include "pipelines/draw/posed_avatar.h"
#include "splat/files/io_ply.h"
#include "tests/support/program.h"

namespace avatar_command_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Contains;

TEST_CASE("hsi4d avatar makes an avatar, tells of it and imports it again") {
  const TemporaryFolder folder;
  const ProgramResult made = run_hsi4d({"avatar", "make", "--gaussians", "2000", "--out", "a.safetensors"});
  CHECK(made.err.empty());
  REQUIRE(made.status == 0);
  CHECK(made.out == "a.safetensors: 2000 Gaussians, 55 joints of SMPL-X\n");
  const Avatar avatar = read_avatar("a.safetensors");
  CHECK(avatar.means == surface_avatar(procedural_body(), {.gaussians = 2000}).means);

  const ProgramResult told = run_hsi4d({"avatar", "info", "a.safetensors"});
  REQUIRE(told.status == 0);
  CHECK_THAT(told.out, Contains("\n  colors   the avatar's own, without a color net\n"));
  CHECK_THAT(told.out,
             Contains("a.safetensors: avatar of 2000 Gaussians, 55 joints of SMPL-X\n  body     the program's own "
                      "(procedural); its pelvis rests at (0, -0.35, -0.005) m\n  shape    the mean one; neutral\n  "
                      "weights  up to 4 a "
                      "Gaussian (1: ") &&
                 Contains("\n  bounds   x -") && Contains("\n  opacity  0.98, 0.98, 0.98, 0.98, 0.98\n") &&
                 Contains("\n  scale    "));
  const ProgramResult arrays = run_hsi4d({"info", "a.safetensors"});
  CHECK_THAT(arrays.out, Contains("a.safetensors: 10 arrays\n") && Contains("\n  means  [2000,3]  <f4\n") &&
                             Contains("\n  format  hsi4d avatar\n") && Contains("\n  version  2\n"));

  write_ply("a.ply", rest_gaussians(avatar));
  const ProgramResult imported = run_hsi4d({"avatar", "import", "a.ply", "--out", "b.safetensors"});
  CHECK(imported.err.empty());
  REQUIRE(imported.status == 0);
  CHECK_THAT(imported.out, Contains("b.safetensors: 2000 Gaussians, 55 joints of SMPL-X; from the surface 0 mm on "
                                    "average, 0 mm at most\n"));
  CHECK(read_avatar("b.safetensors").means == avatar.means);
}

TEST_CASE("hsi4d avatar make keeps the shape of the body in the file") {
  const TemporaryFolder folder;
  REQUIRE(run_hsi4d({"avatar", "make", "--gaussians", "300", "--betas", "1.5,-0.5", "--gender", "female", "--out",
                     "a.safetensors"})
              .status == 0);
  CHECK(read_avatar_shape("a.safetensors") == AvatarShape{"procedural", {1.5, -0.5}, "female"});
  CHECK_THAT(run_hsi4d({"avatar", "info", "a.safetensors"}).out, Contains("\n  shape    betas 1.5, -0.5; female\n"));
  const ProgramResult odd = run_hsi4d({"avatar", "make", "--gender", "tall", "--out", "b.safetensors"});
  CHECK(odd.status == 2);
  CHECK(odd.err == "hsi4d avatar make: --gender: tall is not known; allowed: neutral, female, male\n");
}

TEST_CASE("hsi4d avatar make gives an avatar as many Gaussians as are useful, unless asked for fewer") {
  CHECK(cli::AvatarOptions().settings.gaussians == 50000);
}

TEST_CASE("hsi4d avatar names what is wrong") {
  const TemporaryFolder folder;
  const auto error = [](const std::vector<std::string>& arguments) {
    const ProgramResult result = run_hsi4d(arguments);
    CHECK(result.status == 2);
    return result.err;
  };
  CHECK(error({"avatar"}) == "hsi4d avatar: give a command; known: make, import, fit, info\n");
  CHECK(error({"avatar", "inf"}) ==
        "hsi4d avatar: there is no command \"inf\"; known: make, import, fit, info; did you mean \"info\"?\n");
  CHECK(error({"avatar", "make", "--gaussian", "3"}) ==
        "hsi4d avatar make: there is no option \"--gaussian\"; known: --help, --body-model, --gaussians, --detail, "
        "--cover, --texture, --seed, --betas, --gender, --out; did you mean \"--gaussians\"?\n");
  CHECK_THAT(error({"avatar", "make"}), Contains("hsi4d avatar make: --out is required"));
  CHECK_THAT(error({"avatar", "make", "--out", "a.npz"}), Contains("--out") && Contains(".safetensors"));
  CHECK(error({"avatar", "make", "--out", "a.safetensors", "--gaussians", "0"}) ==
        "avatar: gaussians is 0; allowed: 1 to 5000000\n");
  CHECK(error({"avatar", "make", "--out", "a.safetensors", "--betas", "1,2,3,4,5,6,7,8,9,0,1"}) ==
        "hsi4d avatar make: --betas: 11 numbers; the program's body has 10\n");
  CHECK(error({"avatar", "make", "--out", "a.safetensors", "--betas", "0,-10.5"}) ==
        "hsi4d avatar make: --betas: -10.5 is out of range; allowed: -10 to 10\n");
  CHECK(
      error({"avatar", "make", "--out", "a.safetensors", "--betas", "1,b"}) ==
      "hsi4d avatar make: --betas: \"1,b\" is not understood; allowed: finite numbers apart by commas, as in 0.5,-1\n");
  CHECK(error({"avatar", "make", "--out", "a.safetensors", "--betas", "10,10,10,10,10,10,10,10,10,10"}) ==
        "hsi4d avatar make: --betas: makes pelvis 3.3 times as wide as the mean body's; allowed: 0.5 to 2\n");
  write_text_file("text.safetensors", "some text that is no avatar");
  CHECK_THAT(error({"avatar", "info", "text.safetensors"}),
             Contains("text.safetensors: looks like text, not like a .safetensors file"));
  CHECK_THAT(error({"avatar", "info", "none.safetensors"}), Contains("none.safetensors"));
  write_ply("far.ply", [] {
    Gaussians g;
    g.means = {9, 9, 9};
    g.quats = {1, 0, 0, 0};
    g.log_scales = {0, 0, 0};
    g.opacity_logits = {0};
    g.sh = {0, 0, 0};
    return g;
  }());
  CHECK_THAT(error({"avatar", "import", "far.ply", "--out", "a.safetensors"}),
             Contains("far.ply: 1 of 1 Gaussians are more than 0.15 m from the body"));
  CHECK(read_file_start("far.ply", 3).size() == 3);
  CHECK_THROWS_AS(read_avatar("a.safetensors"), UserError);  // nothing was written
}

}  // namespace avatar_command_test
