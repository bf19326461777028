// What `hsi4d render` and `hsi4d gradients` say of their options, and both through the program.
#include "pipelines/cli/scene_options.h"

#include "core/exr.h"
#include "core/image_io.h"
#include "core/log.h"
#include "tests/pipelines/cli/render_files.h"
#include "tests/support/program.h"

namespace scene_options_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::StartsWith;

TEST_CASE("what is wrong with the options is told to the letter") {
  const Files files;
  const auto render_fault = [](const std::function<void(cli::RenderOptions&)>& change) {
    cli::RenderOptions options = render_options("a.npz");
    change(options);
    return fault([&] { cli::render_command(options); });
  };
  using Options = cli::RenderOptions;
  CHECK(render_fault([](Options&) {}) == "no fault");
  CHECK(render_fault([](Options& o) { o.out = "a.jpg"; }) ==
        "hsi4d render: --out: a.jpg does not end as it must; allowed: .png, .exr, .npz");
  CHECK(render_fault([](Options& o) { o.shared.precision = "duoble"; }) ==
        "hsi4d render: --precision: \"duoble\" is no precision; allowed: float, double, reference; did you mean "
        "\"double\"?");
  for (const std::string wrong : {"1,2", "1,2,3,4", "1,2,x", "", "1, 2, 3", "1,2,inf"}) {
    CHECK(render_fault([&](Options& o) { o.shared.background = wrong; }) ==
          "hsi4d render: --background: \"" + wrong +
              "\" is no colour; allowed: three numbers r,g,b, for example 0.5,0.5,0.5");
  }
  CHECK(render_fault([](Options& o) { o.shared.settings = {"render.blurr=1"}; }) ==
        "--set render.blurr=1: /render/blurr: unknown key; did you mean \"blur\"?");
  CHECK(render_fault([](Options& o) {
          o.shared.settings = {"seed=1", "render.near=-1"};
        }) ==
        "2 problems:\n--set seed=1: /seed: unknown key; known here: render\n"
        "--set render.near=-1: /render/near: -1 is out of range; allowed: above 0 and at most 1000");
  CHECK(render_fault([](Options& o) { o.shared.camera_frame = 1; }) ==
        "camera.json: there is no camera 1; allowed: 0 to 0");
  CHECK(render_fault([](Options& o) { o.motion = "m.npz"; }) ==
        "hsi4d render: --motion is given without --avatar; a body needs both, and --frame");
  CHECK(render_fault([](Options& o) { o.avatar = "a.npz"; }) ==
        "hsi4d render: --avatar is given without --motion; a body needs both, and --frame");
  CHECK(render_fault([](Options& o) { o.shared.scene.clear(); }) ==
        "hsi4d render: nothing to draw; give --scene, --object, or --avatar with --motion");
  CHECK(render_fault([](Options& o) { o.color_net = "n.safetensors"; }) ==
        "hsi4d render: --color-net is given without --avatar, whose colours it says");
  CHECK(render_fault([](Options& o) { o.frame = 2; }) ==
        "hsi4d render: --frame is given without --motion and --avatar, or --objects");
  CHECK_THAT(render_fault([](Options& o) { o.shared.scene = "missing.ply"; }), StartsWith("missing.ply: "));
  CHECK_THAT(render_fault([](Options& o) { o.objects = {"missing.ply"}; }), StartsWith("missing.ply: "));
  CHECK_THAT(render_fault([](Options& o) { o.shared.camera = "missing.json"; }), StartsWith("missing.json: "));

  cli::GradientsOptions options = gradients_options("g.exr");
  CHECK(fault([&] { cli::gradients_command(options); }) ==
        "hsi4d gradients: --out: g.exr does not end as it must; allowed: .npz");
  options = gradients_options("g.npz");
  options.target = "t.jpg";
  CHECK(fault([&] { cli::gradients_command(options); }) ==
        "hsi4d gradients: --target: t.jpg does not end as it must; allowed: .exr, .png, .npz");
}

TEST_CASE("a file that cannot be written is told before the work is done, and nothing is left behind") {
  const Files files;
  std::filesystem::create_directory("folder.npz");
  std::ofstream("file").put('x');
  for (const std::string out : {"file/a.npz", "folder.npz"}) {
    INFO(out);
    NpzWriter npz;
    npz.add<double>("image", {1, 1, 3}, {0, 0, 0});
    const std::string message = fault([&] { npz.write(out); });
    CHECK_THAT(message, StartsWith(out + ": cannot be written: "));
    cli::RenderOptions render = render_options(out);
    cli::GradientsOptions gradients = gradients_options(out);
    CHECK(fault([&] { cli::render_command(render); }) == message);
    CHECK(fault([&] { cli::gradients_command(gradients); }) == message);
    render.shared.scene = gradients.shared.scene = "missing.ply";  // which is read later
    CHECK(fault([&] { cli::render_command(render); }) == message);
    CHECK(fault([&] { cli::gradients_command(gradients); }) == message);
  }
  const auto files_here = [] {
    return std::distance(std::filesystem::directory_iterator("."), std::filesystem::directory_iterator());
  };
  const auto before = files_here();
  for (const std::string out : {"a.npz", "new/folder/a.npz"}) {
    cli::RenderOptions render = render_options(out);
    render.shared.scene = "missing.ply";
    CHECK_THAT(fault([&] { cli::render_command(render); }), StartsWith("missing.ply: "));
    CHECK(files_here() == before);
  }
  cli::render_command(render_options("new/folder/a.npz"));
  CHECK(std::filesystem::exists("new/folder/a.npz"));
}

TEST_CASE("no file that is read is replaced by the result") {
  const Files files;
  cli::RenderOptions render = render_options("poses.npz");
  NpzWriter npz;
  npz.add<double>("image", {1, 1, 3}, {0, 0, 0});
  npz.write("poses.npz");
  const std::string poses = file_text("poses.npz"), target = file_text("target.npz");
  render.objects = {"clean.ply"};
  render.object_poses = "./poses.npz";
  CHECK(fault([&] { cli::render_command(render); }) ==
        "hsi4d render: --out: poses.npz is the file that is read, ./poses.npz, which would be replaced; give another "
        "name");
  CHECK(file_text("poses.npz") == poses);
  std::filesystem::create_symlink("target.npz", "g.npz");
  CHECK(fault([&] { cli::gradients_command(gradients_options("g.npz")); }) ==
        "hsi4d gradients: --out: g.npz is the file that is read, target.npz, which would be replaced; give another "
        "name");
  CHECK(file_text("target.npz") == target);
}

TEST_CASE("rows that are left out are told") {
  const Files files;
  std::string told;
  const LogSink sink = log_to([&](LogLevel, std::string_view message) { told += message; });
  cli::render_command(render_options("a.npz"));
  CHECK(told == "scene.ply: 1 of 9 Gaussians are left out (a mean that is not finite: 1)");
}

TEST_CASE("render and gradients through the program") {
  const Files files;
  const ProgramResult image =
      run_hsi4d({"render", "--scene", "clean.ply", "--object", "clean.ply", "--object", "clean.ply", "--camera",
                 "camera.json", "--out", "a.npz", "--set", "render.blur=0.5", "--precision", "reference"});
  CHECK(image.status == 0);
  CHECK(image.err.empty());
  CHECK(image.out == "a.npz: 37 x 23 pixels of 24 Gaussians\n");
  const ProgramResult warned = run_hsi4d({"gradients", "--scene", "scene.ply", "--camera", "camera.json", "--target",
                                          "target.npz", "--out", "g.npz", "--background=-1,0.5,1"});
  CHECK(warned.status == 0);
  CHECK(warned.err == "hsi4d: warning: scene.ply: 1 of 9 Gaussians are left out (a mean that is not finite: 1)\n");
  CHECK_THAT(warned.out, StartsWith("g.npz: loss 0."));
  CHECK(Npz::read("g.npz").array("loss").dtype() == "<f8");

  const ProgramResult mistake = run_hsi4d(
      {"render", "--scene", "clean.ply", "--camera", "camera.json", "--out", "b.npz", "--set", "render.quality=fats"});
  CHECK(mistake.status == 2);
  CHECK(mistake.out.empty());
  CHECK(
      mistake.err ==
      "--set render.quality=fats: /render/quality: \"fats\" is not one of the choices; allowed: \"fast\", \"default\", "
      "\"accurate\", \"reference\"; did you mean \"fast\"?\n");
  CHECK(!std::filesystem::exists("b.npz"));
  const ProgramResult missing = run_hsi4d({"render", "--scene", "clean.ply", "--out", "b.npz"});
  CHECK(missing.status == 2);
  CHECK(missing.err == "hsi4d render: --camera is required; `hsi4d render --help` explains its arguments\n");
  const ProgramResult size = run_hsi4d({"gradients", "--scene", "clean.ply", "--camera", "camera.json", "--target",
                                        "a.npz", "--out", "g.npz", "--set", "render.tile=8"});
  CHECK(size.status == 0);
}

}  // namespace scene_options_test
