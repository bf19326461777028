#include "pipelines/cli/avatar_fit_command.h"

#include <catch2/catch.hpp>

#include "body/avatar.h"
#include "body/avatar_shape.h"
#include "body/procedural_body.h"
#include "core/check.h"
#include "core/file.h"
#include "core/image_io.h"
#include "optim/loss_term.h"
#include "pipelines/cli/avatar_command.h"
#include "pipelines/input/view_set.h"
#include "pipelines/synthetic/views.h"
#include "tests/support/program.h"
#include "tests/support/tiny_run.h"

namespace avatar_fit_command_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Contains;
namespace fs = std::filesystem;

namespace {

constexpr int kPixels = 24;

/// A few small pictures of three cameras and a config to learn from them, in the current folder.
void write_inputs() {
  SyntheticSettings settings;
  settings.kind = SyntheticKind::kViews;
  settings.size_px = kPixels;
  settings.supersample = 1;
  settings.avatar_gaussians = 300;
  settings.views_cameras = 3;
  settings.views_poses = 1;
  write_views(settings, {}, "views");
  write_text_file("fit.json", R"({
    "views": "views/views.json",
    "gaussians": 200,
    "held_cameras": [2],
    "color_net": {"features": 4, "hidden_width": 8, "hidden_layers": 1},
    "stage": {"iterations": 3, "optimize": {"colors": {"lr": 0.05}}, "losses": {"photometric": {}}}
  })");
}

std::string fit(const std::string& out, const std::vector<std::string>& overrides = {}) {
  return cli::avatar_fit_command({.config = "fit.json", .run = {}, .overrides = overrides, .out = out, .quiet = true},
                                 loss_terms());
}

std::string refusal(const std::string& out, const std::vector<std::string>& overrides = {}) {
  try {
    fit(out, overrides);
  } catch (const UserError& error) {
    return error.what();
  }
  return "no error";
}

}  // namespace

TEST_CASE("hsi4d avatar fit learns an avatar, writes it and tells how well it shows the pictures") {
  const TemporaryFolder folder;
  write_inputs();
  const ProgramResult fitted = run_hsi4d({"avatar", "fit", "fit.json", "--quiet", "--out", "a.safetensors"});
  CHECK(fitted.err.empty());
  REQUIRE(fitted.status == 0);
  CHECK_THAT(fitted.out, Contains("a.safetensors: 200 Gaussians, 3 iterations, loss ") &&
                             Contains("\n  learnt: 2 views, PSNR ") && Contains(" dB, of the human alone ") &&
                             Contains("\n  held back: 1 view, PSNR "));
  const Avatar avatar = read_avatar("a.safetensors");
  CHECK(avatar.count() == 200);
  CHECK(avatar.color_net.has_value());
  CHECK_THAT(
      cli::avatar_info_command("a.safetensors"),
      Contains("\n  colors   a color net of 2 layers (193-8-3): 4 features a Gaussian, pose of 21 joints, without "
               "the direction of view\n"));

  // It goes on from there.
  const std::string again = fit("b.safetensors", {"avatar=a.safetensors", "stage.iterations=1"});
  CHECK_THAT(again, Contains("b.safetensors: 200 Gaussians, 1 iteration, loss "));
  CHECK(read_avatar_shape("a.safetensors") == AvatarShape{"procedural", {}});
  cli::AvatarOptions tall;
  tall.settings.gaussians = 200;
  tall.betas = "1.5";
  tall.out = "tall.safetensors";
  cli::avatar_make_command(tall);
  fit("c.safetensors", {"avatar=tall.safetensors", "stage.iterations=1"});
  CHECK(read_avatar_shape("c.safetensors") == AvatarShape{"procedural", {1.5}});
}

TEST_CASE("configs of avatar fit are known to the other commands") {
  const TemporaryFolder folder;
  write_inputs();
  const auto told = [](const std::vector<std::string>& arguments, int status = 0) {
    const ProgramResult result = run_hsi4d(arguments);
    CHECK(result.status == status);
    return status == 0 ? result.out : result.err;
  };
  CHECK_THAT(told({"check", "fit.json", "--set", "views="}),
             Contains("fit.json: OK, a config of `hsi4d avatar fit`\n  views: not given; --set views=DIR/views.json\n"
                      "  starts from 200 Gaussians on the body\n  stage avatar fit: 3 iterations, 1 parameter group "
                      "(colors), 1 loss (photometric)\n"));
  CHECK_THAT(told({"check", "fit.json", "--print-config"}), Contains("\"held_frames\": []"));
  CHECK(told({"check", "fit.json", "--set", "gausians=3"}, 2) ==
        "--set gausians=3: /gausians: unknown key; did you mean \"gaussians\"?\n");
  CHECK_THAT(told({"schema", "avatar_fit"}), Contains("hsi4d avatar fit config"));
  CHECK_THAT(told({"schema"}), Contains("hsi4d run config"));
  CHECK(told({"schema", "fit"}, 2) ==
        "hsi4d schema: there are no configs of \"fit\"; known: run, avatar_fit, reconstruct, sweep\n");
  CHECK_THAT(told({"list", "avatar_fit"}), Contains("/held_cameras"));
  const std::string other =
      "fit.json: is a config of `hsi4d avatar fit`, which learns an avatar from pictures: hsi4d avatar "
      "fit fit.json --out F.safetensors\n";
  CHECK(told({"run", "fit.json"}, 2) == other);
  CHECK(told({"synth", "fit.json", "--out", "d"}, 2) == other);
  write_text_file("run.json", R"({"stages": {}})");
  CHECK(told({"avatar", "fit", "run.json", "--out", "a.safetensors"}, 2) ==
        "run.json: is a config of `hsi4d run` and `hsi4d synth`, not of `hsi4d avatar fit`; configs/avatar/fit.json is "
        "one\n");
}

TEST_CASE("hsi4d avatar fit tells what its config lacks, and what says nothing") {
  const TemporaryFolder folder;
  write_inputs();
  CHECK(refusal("a.safetensors", {"views="}) ==
        "fit.json:1: /views: not given; a fit needs the views.json of pictures in known poses. `hsi4d synth "
        "configs/avatar/views.json --out DIR` makes some; then --set views=DIR/views.json");
  write_avatar("start.safetensors", surface_avatar(procedural_body(), {.gaussians = 100}));
  const std::string start = fs::absolute("start.safetensors").string();
  CHECK(refusal("a.safetensors", {"avatar=start.safetensors", "gaussians=300"}) ==
        "--set gaussians=300: /gaussians: is of a new avatar; this fit goes on from " + start + ", /avatar, as it is");
  CHECK(refusal("a.safetensors", {"avatar=start.safetensors", "body.shape=[1]"}) ==
        "--set body.shape=[1]: /body: is of a new avatar; this fit goes on from " + start + ", /avatar, as it is");
  CHECK(refusal("a.safetensors", {R"(stage.losses={"joint_limits": {}})"}) ==
        "--set stage.losses={\"joint_limits\": {}}: /stage/losses/joint_limits: this loss needs the body, which a fit "
        "of an "
        "avatar does not have");
  ViewSet set = read_view_set("views/views.json");
  for (PosedView& view : set.views) view.image = fs::path("images") / view.image.filename();
  set.views[1].camera = -1;
  write_text_file("views/odd.json", view_set_json("motion.npz", "cameras.json", set.views));
  CHECK_THAT(refusal("a.safetensors", {"views=views/odd.json"}),
             Contains("/views/1/camera: -1 is out of range; allowed: 0 or more"));
  CHECK(refusal("a.safetensors", {"views=views/motion.npz"}) ==
        fs::absolute("views/motion.npz").string() + ": looks like a .npz or .zip archive, not like JSON");
}

TEST_CASE("hsi4d avatar fit says nothing of the human alone where nothing tells which pixels show it") {
  const TemporaryFolder folder;
  write_inputs();
  for (const char* name : {"views/images/0000.png", "views/images/0001.png", "views/images/0002.png"}) {
    write_image(name, take_channels(read_image(name), 0, 3));
  }
  const std::string told = fit("a.safetensors", {"stage.iterations=1", "color_net.use=off"});
  CHECK_THAT(told, Contains("held back: 1 view, PSNR ") && !Contains("of the human alone"));
}

TEST_CASE("hsi4d avatar fit looks where it writes before it learns, and replaces nothing that it reads") {
  const TemporaryFolder folder;
  write_inputs();
  ViewSet set = read_view_set("views/views.json");
  for (PosedView& view : set.views) view.image = fs::path("images") / view.image.filename();
  write_image("views/mask.png", Image(1, kPixels, kPixels));
  set.views[1].mask = "mask.png";
  write_text_file("views/views.json", view_set_json("motion.npz", "cameras.json", set.views));
  cli::AvatarOptions start;
  start.settings.gaussians = 100;
  start.out = "start.safetensors";
  cli::avatar_make_command(start);
  const std::vector<std::string> goes_on = {"avatar=start.safetensors"};

  CHECK(refusal("a.npz") == "hsi4d avatar fit: --out: a.npz does not end as it must; allowed: .safetensors");
  CHECK(refusal("views/images/0000.png") ==
        "hsi4d avatar fit: --out: views/images/0000.png does not end as it must; allowed: .safetensors");
  for (const char* name : {"fit.json", "views/views.json", "views/motion.npz", "views/cameras.json",
                           "views/images/0000.png", "views/images/0002.png", "views/mask.png", "start.safetensors"}) {
    const std::string before = file_text(name);
    fs::remove("link.safetensors");
    fs::create_symlink(name, "link.safetensors");
    const std::string told = refusal("link.safetensors", goes_on);
    CHECK_THAT(told, Contains("hsi4d avatar fit: --out: link.safetensors is the file that is read, ") &&
                         Contains(fs::path(name).filename().string() + ", which would be replaced"));
    CHECK(file_text(name) == before);
  }
  CHECK_THAT(refusal("start.safetensors", goes_on), Contains("start.safetensors is the file that is read"));

  // Told before a picture is looked at: this one would be refused.
  write_image("views/images/0001.png", Image(3, 5, 5));
  CHECK_THAT(refusal("views/mask.png/a.safetensors"), Contains("views/mask.png/a.safetensors: cannot be written"));
  CHECK_THROWS_WITH(fit("a.safetensors"), Contains("is 5x5 pixels"));
  CHECK_FALSE(fs::exists("a.safetensors"));
}

TEST_CASE("hsi4d avatar fit learns from the frames of a run, beginning with its avatar") {
  const TemporaryFolder folder;
  execute_tiny(tiny_config({"stages.camera.iterations=1", "stages.interaction.iterations=1"}), "run");
  const ProgramResult fitted = run_hsi4d({"avatar", "fit", "--run", "run", "--set", "stage.iterations=4", "--set",
                                          "held_frames=[2]", "--quiet", "--out", "a.safetensors"});
  CAPTURE(fitted.err);
  REQUIRE(fitted.status == 0);
  CHECK_THAT(fitted.out, Contains("a.safetensors: 500 Gaussians, 4 iterations, loss ") &&
                             Contains("\n  before: 3 views, PSNR ") && Contains("\n  learnt: 3 views, PSNR ") &&
                             Contains(", silhouette IoU ") && Contains("\n  held back: 1 view, PSNR "));
  const Avatar first = read_avatar(tiny_config().data.avatar.string()), learnt = read_avatar("a.safetensors");
  CHECK(learnt.colors != first.colors);
  CHECK(learnt.means != first.means);
  CHECK(learnt.log_scales == first.log_scales);
  CHECK(learnt.joints == first.joints);

  // As views that are files, with a config of its own.
  write_text_file("own.json", R"({"stage": {"iterations": 2, "optimize": {"opacity_logits": {"lr": 0.1}},
                                            "losses": {"photometric": {}}}, "color_net": {"use": "off"}})");
  CHECK_THAT(run_hsi4d({"avatar", "fit", "own.json", "--run", "run", "--quiet", "--out", "b.safetensors"}).out,
             Contains("b.safetensors: 500 Gaussians, 2 iterations"));
  CHECK(read_avatar("b.safetensors").colors == first.colors);
}

TEST_CASE("hsi4d avatar fit of a run takes the avatar that the run found, and its lens") {
  const TemporaryFolder folder;
  execute_tiny(tiny_config({"stages.camera.iterations=1", "stages.interaction.iterations=1"}), "run");
  const auto fit_of_run = [](const std::string& out) {
    const ProgramResult fitted = run_hsi4d(
        {"avatar", "fit", "--run", "run", "--set", "stage.iterations=4", "--quiet", "--out", out + ".safetensors"});
    CAPTURE(fitted.err);
    REQUIRE(fitted.status == 0);
    return fitted.out;
  };
  const auto figures = [](const std::string& text, const std::string& of) {
    const std::size_t begin = text.find(of) + of.size();
    return text.substr(begin, text.find('\n', begin) - begin);
  };
  const std::string first = fit_of_run("first");
  fs::copy_file("first.safetensors", "run/avatar.safetensors");
  const std::string second = fit_of_run("second");
  CHECK(figures(first, "  before: ") != figures(first, "  learnt: "));
  CHECK(figures(second, "  before: ") == figures(first, "  learnt: "));

  const auto set_k1 = [](const nlohmann::json& k1) {
    write_changed("run/config.resolved.json", "run/config.resolved.json",
                  [&](auto& config) { config["data"]["lens"]["k1"] = k1; });
  };
  set_k1(0.4);
  CHECK(figures(fit_of_run("bent"), "  before: ") != figures(second, "  before: "));
  set_k1("estimate");
  const ProgramResult refused = run_hsi4d({"avatar", "fit", "--run", "run", "--quiet", "--out", "a.safetensors"});
  CHECK(refused.status == 2);
  CHECK_THAT(refused.err, Contains("config.resolved.json: /data/lens/k1: is \"estimate\""));
}

TEST_CASE("hsi4d avatar fit refuses what is no run that is done") {
  const TemporaryFolder folder;
  write_inputs();
  const auto error = [](std::vector<std::string> more) {
    more.insert(more.begin(), {"avatar", "fit", "--quiet", "--out", "a.safetensors"});
    const ProgramResult result = run_hsi4d(more);
    CHECK(result.status == 2);
    return result.err;
  };
  CHECK_THAT(error({}), Contains("hsi4d avatar fit: neither a config nor --run"));
  CHECK_THAT(error({"--run", "none"}), Contains("none: holds no config.resolved.json; allowed: the folder of a run"));
  execute_tiny(tiny_config({"stages.camera.iterations=1", "stages.interaction.iterations=1"}), "run");
  CHECK_THAT(error({"fit.json", "--run", "run"}), Contains("views.json; with --run the views are the run's frames"));
  CHECK_THAT(error({"--run", "run", "--set", "gaussians=30"}), Contains("/gaussians: is of a new avatar"));
  Motion motion = read_motion("run/motion.npz");
  motion.poses.pop_back();
  write_motion("run/motion.npz", motion);
  CHECK_THAT(error({"--run", "run"}), Contains("run: has 3 poses and 4 cameras, its video 4 frames"));
  fs::remove("run/motion.npz");
  CHECK_THAT(error({"--run", "run"}), Contains("run: holds no motion.npz"));
}

TEST_CASE("hsi4d avatar fit refuses to hold back what is not there") {
  const TemporaryFolder folder;
  write_inputs();
  CHECK_THAT(refusal("a.safetensors", {"held_cameras=[2,9]"}),
             Contains("fit.json: /held_cameras/1: no view of ") &&
                 Contains("views.json is of camera 9; there are 3, counted from 0"));
  CHECK_THAT(refusal("a.safetensors", {"held_frames=[1]"}),
             Contains("fit.json: /held_frames/0: no view of ") &&
                 Contains("views.json is of frame 1; there are 1, counted from 0"));
  CHECK_FALSE(fs::exists("a.safetensors"));
}

}  // namespace avatar_fit_command_test
