#include "pipelines/cli/info_command.h"

#include <cmath>
#include <filesystem>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "core/camera_file.h"
#include "core/check.h"
#include "core/exr.h"
#include "core/file.h"
#include "core/image_io.h"
#include "core/npz.h"
#include "core/text.h"
#include "core/video.h"
#include "splat/files/io_ply.h"
#include "splat/files/splat_file.h"
#include "tests/support/program.h"

namespace info_command_test {

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
        "g.ply: 2 Gaussians, spherical harmonics of degree 1, INRIA PLY\n"
        "  faults   1 of 3 Gaussians are left out (a mean that is not finite: 1); log-scales held within ±20: 1\n"
        "  bounds   x -1 to 1, y 2 to 5, z 0 to 3 m\n"
        "  opacity  0.5, 0.5, 0.5, 0.5, 0.5\n"
        "  scale    2.061e-09, 2.061e-09, 1, 1, 1 m\n"
        "  (smallest, 5 %, median, 95 %, largest; scale: standard deviations along all axes)\n"
        "  opacity  0 to 0.1           0\n"
        "           0.1 to 0.2         0\n"
        "           0.2 to 0.3         0\n"
        "           0.3 to 0.4         0\n"
        "           0.4 to 0.5         0\n"
        "           0.5 to 0.6         100 %      ########################################\n"
        "           0.6 to 0.7         0\n"
        "           0.7 to 0.8         0\n"
        "           0.8 to 0.9         0\n"
        "           0.9 to 1           0\n"
        "  scale    1e-09 to 1e-08     16.67 %    ########\n"
        "           1e-08 to 1e-07     0\n"
        "           1e-07 to 1e-06     0\n"
        "           1e-06 to 1e-05     0\n"
        "           1e-05 to 0.0001    0\n"
        "           0.0001 to 0.001    0\n"
        "           0.001 to 0.01      0\n"
        "           0.01 to 0.1        0\n"
        "           0.1 to 1           83.33 %    ########################################\n");
  write_ply("none.PLY", Gaussians{});
  CHECK(cli::info_command("none.PLY") ==
        "none.PLY: 0 Gaussians, spherical harmonics of degree 0, INRIA PLY\n  faults   none\n"
        "  notice   the file holds no Gaussians\n");
  write_text_file("empty.splat", "");
  CHECK_THAT(cli::info_command("empty.splat"), Catch::Matchers::Contains("  notice   the file holds no Gaussians\n"));

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

  CHECK_THROWS_MATCHES(
      cli::info_command("a.plly"), UserError,
      Message("hsi4d info: a.plly: nothing is known of files that end in \".plly\"; allowed: " +
              joined(splat_endings()) + ", .npz, .npy, .safetensors, .json, .png, .jpg, .jpeg, .exr and videos: " +
              video_endings() + "; did you mean \".ply\"?"));
  const ProgramResult missing = run_hsi4d({"info", "missing.ply"});
  CHECK(missing.status == 2);
  CHECK(missing.out.empty());
  CHECK_THAT(missing.err, Catch::Matchers::StartsWith("missing.ply: "));
  const ProgramResult done = run_hsi4d({"info", "a.npz"});
  CHECK(done.status == 0);
  CHECK(done.out == cli::info_command("a.npz"));
}

TEST_CASE("info knows Gaussians by what is in the file, as render does, and says which are not read") {
  const TemporaryFolder folder;
  Gaussians g;
  g.means = {1, 2, 3};
  g.quats = {1, 0, 0, 0};
  g.log_scales = {0, 0, 0};
  g.opacity_logits = {0};
  g.sh.resize(3);
  write_ply("g.ply", g);
  const std::string told = cli::info_command("g.ply");
  CHECK_THAT(told, Catch::Matchers::StartsWith("g.ply: 1 Gaussian, spherical harmonics of degree 0, INRIA PLY\n"));
  for (const std::string name : {"g.gaussians", "g", "g.npz"}) {
    std::filesystem::copy_file("g.ply", name);
    CHECK(cli::info_command(name) == name + told.substr(5));
    CHECK(nlohmann::json::parse(cli::info_command(name, true))["count"] == 1);
  }
  write_text_file("g.ksplat", "any bytes");
  for (const bool json : {false, true})
    CHECK_THROWS_MATCHES(cli::info_command("g.ksplat", json), UserError,
                         Message("g.ksplat: .ksplat files are not read; Gaussians are read from " +
                                 splat_formats_text() + ", into which the tool that wrote it can convert it"));
  g.means = {NAN, 2, 3};
  write_ply("g.ply", g);
  CHECK_THAT(cli::info_command("g.ply"), Catch::Matchers::StartsWith("g.ply: 0 Gaussians, ") &&
                                             Catch::Matchers::EndsWith("\n  notice   no Gaussian is left\n"));
}

TEST_CASE("info tells what other JSON is, and that a folder is none of its files") {
  const TemporaryFolder folder;
  folder.write("run.json", R"({"name": "x", "stages": {}})");
  folder.write("summary.json", R"({"name": "x", "frames": 4})");
  folder.write("wrong.json", R"({"width": 4})");
  CHECK(cli::info_command("run.json") == "run.json: a config (`hsi4d check` tells its faults) with name stages\n");
  CHECK(cli::info_command("summary.json") == "summary.json: JSON with name frames\n");
  CHECK_THROWS(cli::info_command("wrong.json"));
  CHECK_THROWS_WITH(cli::info_command("."),
                    "hsi4d info: . is a folder without .png frames; allowed: a file, or a folder of frames (`hsi4d "
                    "report` and `hsi4d evaluate` tell of the folder of a run)");
}

TEST_CASE("info tells what a clip reads of frames, in the words of its options") {
  const TemporaryFolder folder;
  std::filesystem::create_directory("frames");
  for (int t = 0; t < 6; ++t) write_image("frames/" + std::to_string(t) + ".png", Image(3, 20, 40));
  CHECK(cli::video_info("frames", {}, {}) == "frames: 6 frames of 40 x 20 pixels, no rate is known\n");
  CHECK(cli::video_info("frames", 10, 5) ==
        "frames: 6 frames of 40 x 20 pixels, 10 a second; a clip of 5 a second has 3 frames\n");
  CHECK_THROWS_WITH(cli::video_info("frames", {}, 5),
                    "frames: does not say how many frames a second it has, so that 5 of them cannot be kept; "
                    "--video-rate says it");
  CHECK_THROWS_WITH(cli::video_info("frames", 10, 20),
                    "frames: has 10 frames a second; --frame-rate, 20, cannot be more");
  CHECK_THROWS_WITH(cli::video_info("frames", 10, 1), "frames: gives 1 of its 6 frames; a clip needs at least 2");
  CHECK_THROWS_WITH(cli::video_info("frames", -1, {}),
                    Catch::Matchers::Contains("hsi4d info: --video-rate: -1 is out of "
                                              "range"));
  CHECK(run_hsi4d({"info", "frames", "--video-rate", "10", "--frame-rate", "5"}).out ==
        cli::video_info("frames", 10, 5));
  write_text_file("a.txt", "");
  const ProgramResult other = run_hsi4d({"info", "a.txt", "--frame-rate", "5"});
  CHECK(other.status == 2);
  CHECK(other.err == "hsi4d info: --video-rate and --frame-rate are of a video or a folder of frames\n");
}

TEST_CASE("info names what is allowed and seldom meant") {
  const TemporaryFolder folder;
  Gaussians g;
  for (int i = 0; i < 20; ++i) {
    g.means.insert(g.means.end(), {static_cast<float>(i), 0, 0});
    g.quats.insert(g.quats.end(), {1, 0, 0, 0});
    g.log_scales.insert(g.log_scales.end(), {-3, -3, -3});
    g.opacity_logits.push_back(0);
    g.sh.insert(g.sh.end(), {0, 0, 0});
  }
  write_ply("g.ply", g);
  CHECK(cli::info_command("g.ply").find("notice") == std::string::npos);
  g.means[3] = 0;            // where the first one is
  g.opacity_logits[2] = -6;  // 0.0025
  g.log_scales[9] = 4;       // 54 m in a scene of 18; and a needle
  g.log_scales[12] = 1.7F;   // a needle
  write_ply("g.ply", g);
  CHECK_THAT(
      cli::info_command("g.ply"),
      Catch::Matchers::Contains("  notice   at the place of an earlier one: 1, fainter than 1/255: 1, larger than "
                                "the scene: 1, needles (100 : 1): 2\n"));
}

TEST_CASE("info gives Gaussians as JSON") {
  const TemporaryFolder folder;
  Gaussians g;
  g.means = {1, 2, 3, -1, 5, 0, 0, 0, NAN};
  g.quats = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};
  g.log_scales = {0, 0, -30, 0, 0, 0, 0, 0, 0};
  g.opacity_logits = {0, 0, 0};
  g.sh.resize(9);
  write_ply("g.ply", g);
  const ProgramResult done = run_hsi4d({"info", "--json", "g.ply"});
  CHECK(done.status == 0);
  const auto json = nlohmann::json::parse(done.out);
  CHECK(json["file"] == "g.ply");
  CHECK(json["format"] == "INRIA PLY");
  CHECK(json["rows"] == 3);
  CHECK(json["count"] == 2);
  CHECK(json["sh_degree"] == 0);
  CHECK(json["faults"]["rejected"] == 1);
  CHECK(json["faults"]["rejections"] == nlohmann::json({{"a mean that is not finite", 1}}));
  CHECK(json["faults"]["repairs"] == nlohmann::json({{"log-scales held within ±20", 1}}));
  CHECK(json["bounds"]["lower"] == nlohmann::json({-1, 2, 0}));
  CHECK(json["bounds"]["upper"] == nlohmann::json({1, 5, 3}));
  CHECK(json["opacity"]["median"] == 0.5);
  CHECK(json["opacity"]["histogram"]["counts"] == nlohmann::json({0, 0, 0, 0, 0, 2, 0, 0, 0, 0}));
  CHECK(json["scale"]["histogram"]["edges"].size() == json["scale"]["histogram"]["counts"].size() + 1);
  CHECK(json["suspicious"]["duplicates"] == 0);
  CHECK(json["notes"].empty());
  write_ply("none.ply", Gaussians{});
  CHECK(nlohmann::json::parse(cli::info_command("none.ply", true))["count"] == 0);
  CHECK_THROWS_WITH(cli::info_command("a.npz", true),
                    "hsi4d info: --json tells of Gaussians; allowed: " + joined(splat_endings()));
}

}  // namespace info_command_test
