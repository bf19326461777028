#include "pipelines/cli/info_command.h"

#include <cmath>

#include <catch2/catch.hpp>

#include "core/camera_file.h"
#include "core/check.h"
#include "core/exr.h"
#include "core/image_io.h"
#include "core/npz.h"
#include "splat/io_ply.h"
#include "tests/support/program.h"

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Message;

TEST_CASE("info tells what is in a file") {
  const TemporaryFolder folder;
  Gaussians g;
  g.sh_degree = 1;
  g.means = {1, 2, 3, -1, 5, 0, 0, 0, NAN};
  g.quats = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};
  g.log_scales = {0, 0, -30, 0, 0, 0, 0, 0, 0};
  g.opacity_logits = {0, 0, 0};
  g.sh.resize(36);
  write_ply("g.ply", g);
  CHECK(cli::info_command("g.ply") ==
        "g.ply: 2 Gaussians, spherical harmonics of degree 1\n"
        "  1 of 3 Gaussians are left out (a mean that is not finite: 1); log-scales held within ±20: 1\n"
        "  bounds   x -1 to 1, y 2 to 5, z 0 to 3 m\n"
        "  opacity  0.5, 0.5, 0.5, 0.5, 0.5\n"
        "  scale    2.061e-09, 2.061e-09, 1, 1, 1 m\n"
        "  (smallest, 5 %, median, 95 %, largest; scale: standard deviations along all axes)\n");
  write_ply("none.PLY", Gaussians{});
  CHECK(cli::info_command("none.PLY") == "none.PLY: 0 Gaussians, spherical harmonics of degree 0\n");

  NpzWriter npz;
  npz.add<float>("weights", {2, 3}, std::vector<float>(6));
  npz.add_text("gender", "neutral");
  npz.write("a.npz");
  CHECK(cli::info_command("a.npz") == "a.npz: 2 arrays\n  weights  [2,3]  <f4\n  gender  []  <U7\n");

  Camera camera;
  camera.width = 640;
  camera.height = 480;
  camera.fx = camera.fy = 500;
  camera.cx = 320;
  camera.cy = 240.5;
  camera.camera_from_world.translation = {0, 0, 2};
  write_camera("c.json", camera);
  CHECK(cli::info_command("c.json") ==
        "c.json: 1 camera\n  0  640 x 480 pixels, fx 500, fy 500, cx 320, cy 240.5, at (0, 0, -2) m\n");

  write_image("i.png", Image(4, 3, 5));
  CHECK(cli::info_command("i.png") == "i.png: 5 x 3 pixels, 4 channels (RGB and alpha)\n");
  write_image("i.jpg", Image(1, 3, 5));
  CHECK(cli::info_command("i.jpg") == "i.jpg: 5 x 3 pixels, 1 channel (grey)\n");
  write_layers("i.exr", {{"R", "Z"}, Image(2, 3, 5), ""});
  CHECK(cli::info_command("i.exr") == "i.exr: 5 x 3 pixels, layers R Z\n");

  CHECK_THROWS_MATCHES(cli::info_command("a.plly"), UserError,
                       Message("hsi4d info: a.plly: nothing is known of files that end in \".plly\"; allowed: .ply, "
                               ".npz, .npy, .json, .png, .jpg, .jpeg, .exr; did you mean \".ply\"?"));
  const ProgramResult missing = run_hsi4d({"info", "missing.ply"});
  CHECK(missing.status == 2);
  CHECK(missing.out.empty());
  CHECK_THAT(missing.err, Catch::Matchers::StartsWith("missing.ply: "));
  const ProgramResult done = run_hsi4d({"info", "a.npz"});
  CHECK(done.status == 0);
  CHECK(done.out == cli::info_command("a.npz"));
}
