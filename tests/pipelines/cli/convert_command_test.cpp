#include "pipelines/cli/convert_command.h"

#include <cmath>
#include <filesystem>
#include <fstream>

#include <catch2/catch.hpp>

#include "core/camera_file.h"
#include "core/check.h"
#include "core/npz.h"
#include "core/text.h"
#include "pipelines/cli/gradients_command.h"
#include "pipelines/cli/info_command.h"
#include "pipelines/cli/render_command.h"
#include "splat/files/io_ply.h"
#include "splat/files/splat_file.h"
#include "splat/files/transform.h"
#include "tests/support/program.h"
#include "tests/support/splat_files.h"
#include "tests/support/splat_scenes.h"

namespace convert_command_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
using Catch::Matchers::StartsWith;

namespace {

std::string fault(cli::ConvertOptions options) {
  options.in = "in.ply";
  if (options.out.empty()) options.out = "out.ply";
  try {
    cli::convert_command(options);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "no fault";
}

Gaussians converted(cli::ConvertOptions options) {
  options.in = "in.ply";
  options.out = "out.ply";
  cli::convert_command(options);
  return read_splats("out.ply").gaussians;
}

}  // namespace

TEST_CASE("convert writes every format and says what is lost") {
  const TemporaryFolder folder;
  const Gaussians g = plain_gaussians(12, 1);
  write_ply("in.ply", g);
  CHECK(cli::convert_command({.in = "in.ply", .out = "out.ply"}) ==
        "out.ply: 12 Gaussians, harmonics of degree 1, " + std::to_string(std::filesystem::file_size("in.ply")) +
            " bytes\n");
  CHECK(file_text("out.ply") == file_text("in.ply"));
  CHECK(cli::convert_command({.in = "in.ply", .out = "out.splat"}) ==
        "out.splat: 12 Gaussians, harmonics of degree 0, 384 bytes\n  not held by the format: Gaussians without their "
        "harmonics of degree 1 and more: 12\n");
  const ProgramResult done = run_hsi4d({"convert", "in.ply", "out.spz", "--spz-version", "4", "--spz-sh-bits", "5,4"});
  CHECK(done.status == 0);
  CHECK_THAT(done.out, StartsWith("out.spz: 12 Gaussians, harmonics of degree 1, "));
  CHECK(read_splats("out.spz").report.format == ".spz version 4");
  CHECK(run_hsi4d({"convert", "out.spz", "back.compressed.ply"}).status == 0);
  CHECK(read_splats("back.compressed.ply").report.format == "compressed PLY");
  CHECK(cli::info_command("back.compressed.ply")
            .starts_with("back.compressed.ply: 12 Gaussians, spherical harmonics of degree 1, compressed PLY\n"));
}

TEST_CASE("convert moves far means before it rounds them, and says what it cannot keep") {
  const TemporaryFolder folder;
  std::string text = "ply\nformat ascii 1.0\nelement vertex 1\n";
  for (const char* name : {"x", "y", "z"}) text += std::string("property double ") + name + "\n";
  for (const char* name :
       {"scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3", "opacity", "f_dc_0", "f_dc_1", "f_dc_2"})
    text += std::string("property float ") + name + "\n";
  folder.write("in.ply", text + "end_header\n431250.1234567 5411873.7654321 12.5 -4 -4 -9 1 0 0 0 0.5 0.1 0.2 0.3\n");
  const Gaussians moved = converted({.translate = "-431250,-5411870,1"});
  CHECK(moved.means == std::vector<float>{static_cast<float>(431250.1234567 - 431250),
                                          static_cast<float>(5411873.7654321 - 5411870), 13.5F});
  const Gaussians turned = converted({.scale = 2, .rotate = "0,0,90", .translate = "10823740,-862500,0"});
  CHECK(turned.means[0] == Approx(-2 * 3.7654321).margin(1e-6));  // x' = -2 y + t, y' = 2 x + t
  CHECK(turned.means[1] == Approx(2 * 0.1234567).margin(1e-6));
  CHECK_THAT(cli::convert_command({.in = "in.ply", .out = "out.ply"}),
             Contains("  not held by the format: means in steps wider than their Gaussian: 1\n"));
}

TEST_CASE("convert keeps the flag of antialiasing in .spz and says where it is lost") {
  const TemporaryFolder folder;
  SplatWriteOptions options;
  options.spz.antialiased = true;
  write_splats("a.spz", plain_gaussians(4, 0), options);
  CHECK_THAT(cli::convert_command({.in = "a.spz", .out = "b.spz"}), !Contains("not held"));
  CHECK(read_splats("b.spz").report.antialiased);
  CHECK_THAT(
      cli::convert_command({.in = "b.spz", .out = "c.ply"}),
      Contains("  not held by the format: trained with antialiasing; render.antialias=true draws them as they were "
               "trained\n"));
  CHECK_THAT(cli::info_command("b.spz"), Contains("  note     trained with antialiasing: render.antialias=true"));
  CHECK(cli::info_command("b.spz", true).find("\"antialiased\": true") != std::string::npos);
}

TEST_CASE("convert scales, then turns, then moves, a matrix says the same") {
  const TemporaryFolder folder;
  const Gaussians g = plain_gaussians(12, 3);
  write_ply("in.ply", g);
  const Gaussians moved = converted({.scale = 2, .rotate = "0,0,90", .translate = "10,20,-30"});
  for (std::size_t n = 0; n < 12; ++n) {
    CHECK(moved.means[3 * n] == Approx(-2 * g.means[3 * n + 1] + 10).margin(1e-5));
    CHECK(moved.means[3 * n + 1] == Approx(2 * g.means[3 * n] + 20).margin(1e-5));
    CHECK(moved.means[3 * n + 2] == Approx(2 * g.means[3 * n + 2] - 30).margin(1e-5));
    CHECK(moved.log_scales[3 * n] == Approx(g.log_scales[3 * n] + std::log(2.0F)));
  }
  const Gaussians by_matrix = converted({.matrix = "0,-2,0,10,2,0,0,20,0,0,2,-30,0,0,0,1"});
  CHECK(largest_difference(by_matrix.means, moved.means) < 1e-5);
  CHECK(largest_difference(by_matrix.sh, moved.sh) < 1e-6);
  CHECK(largest_angle(by_matrix, moved) < 1e-6);
  const Gaussians turned = converted({.rotate = "90,0,0"});
  CHECK(largest_difference(converted({.rotate = "45,0,0"}).means, turned.means) > 0.1);
  CHECK(turned.means[1] == Approx(-g.means[2]).margin(1e-6));  // y becomes z
  CHECK(turned.means[2] == Approx(g.means[1]).margin(1e-6));
}

TEST_CASE("convert leaves out what it is told to") {
  const TemporaryFolder folder;
  Gaussians g = plain_gaussians(4, 2);
  g.means = {0, 0, 0, 1, 1, 1, 2, 2, 2, 1.5F, -1, 0};
  g.opacity_logits = {0, 3, 0, -3};
  write_ply("in.ply", g);
  cli::ConvertOptions options = {.in = "in.ply", .out = "out.ply", .translate = "100,0,0", .crop = "0,0,0,2,1,1"};
  CHECK_THAT(cli::convert_command(options), StartsWith("out.ply: 2 Gaussians of 4, harmonics of degree 2, "));
  CHECK(read_splats("out.ply").gaussians.means == std::vector<float>{100, 0, 0, 101, 1, 1});
  CHECK(converted({.min_opacity = 0.5}).means == std::vector<float>{0, 0, 0, 1, 1, 1, 2, 2, 2});
  const Gaussians flat = converted({.sh_degree = 0});
  CHECK(flat.sh_degree == 0);
  CHECK(flat.sh == dc_of(g));
  const Gaussians more = converted({.sh_degree = 3});
  CHECK(more.sh_degree == 3);
  CHECK(more.sh[26] == g.sh[26]);
  CHECK(more.sh[27] == 0);
  CHECK(converted({.crop = "50,50,50,60,60,60"}).count() == 0);
}

TEST_CASE("what is wrong with convert's options is told, nothing is written") {
  const TemporaryFolder folder;
  write_ply("in.ply", plain_gaussians(2, 0));
  CHECK(fault({.rotate = "1,2"}) ==
        "hsi4d convert: --rotate: \"1,2\" is not understood; allowed: 3 finite numbers x,y,z");
  CHECK(fault({.translate = "1,2,3,4"}) ==
        "hsi4d convert: --translate: \"1,2,3,4\" is not understood; allowed: 3 finite numbers x,y,z");
  CHECK_THAT(fault({.translate = "1,2,inf"}), Contains("is not understood"));
  CHECK_THAT(fault({.translate = "1,2,3 "}), Contains("is not understood"));
  CHECK(fault({.scale = -1}) == "hsi4d convert: --scale: -1 is no scale; allowed: a finite number above 0");
  CHECK(fault({.scale = 2, .matrix = "1"}) ==
        "hsi4d convert: --matrix says everything; leave out --scale, --rotate and --translate");
  CHECK_THAT(fault({.matrix = "-1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1"}),
             Contains("hsi4d convert: --matrix: the matrix mirrors"));
  CHECK(fault({.crop = "1,0,0,0,1,1"}) ==
        "hsi4d convert: --crop: \"1,0,0,0,1,1\" ends before it begins; allowed: the least x, y, z, then the greatest");
  CHECK(fault({.min_opacity = 1.5}) == "hsi4d convert: --min-opacity: 1.5 is no opacity; allowed: 0 to 1");
  CHECK(fault({.sh_degree = 4}) == "hsi4d convert: --sh-degree: 4 is no degree; allowed: 0 to 3");
  CHECK(fault({.out = "out.spz", .spz_version = 1}) ==
        "hsi4d convert: --spz-version: 1 is not written; allowed: 2, 3, 4");
  CHECK(fault({.out = "out.spz", .spz_version = -1}) ==
        "hsi4d convert: --spz-version: -1 is not written; allowed: 2, 3, 4");
  CHECK(fault({.spz_version = 4}) == "hsi4d convert: --spz-version says how .spz files are written; out.ply is none");
  CHECK(fault({.out = "out.splat", .spz_sh_bits = "5,4"}) ==
        "hsi4d convert: --spz-sh-bits says how .spz files are written; out.splat is none");
  CHECK(fault({.out = "out.spz", .spz_sh_bits = "5,9"}) ==
        "hsi4d convert: --spz-sh-bits: \"5,9\" are no numbers of bits; allowed: two whole numbers from 1 to 8, for "
        "example 5,4");
  CHECK(fault({.out = "out.ksplat"}) ==
        "hsi4d convert: OUT: out.ksplat does not end as it must; allowed: " + joined(written_splat_endings()));
  CHECK_THAT(fault({.out = "in.ply/out.ply"}), Contains("in.ply/out.ply: cannot be written: Not a directory"));
  CHECK_FALSE(std::filesystem::exists("out.ply"));
  CHECK(run_hsi4d({"convert", "in.ply"}).status == 2);
  const ProgramResult missing = run_hsi4d({"convert", "none.spz", "out.ply"});
  CHECK(missing.status == 2);
  CHECK_THAT(missing.err, StartsWith("none.spz: "));
}

TEST_CASE("convert does not replace the file that it reads, whatever it is called") {
  const TemporaryFolder folder;
  write_ply("in.ply", plain_gaussians(2, 0));
  std::filesystem::create_directory("sub");
  std::filesystem::create_symlink("in.ply", "link.ply");
  std::filesystem::create_hard_link("in.ply", "hard.ply");
  const std::string before = file_text("in.ply");
  for (const std::string out : {"in.ply", "./in.ply", "sub/../in.ply", "link.ply", "hard.ply"}) {
    INFO(out);
    CHECK(fault({.out = out, .scale = 2}) == "hsi4d convert: OUT: " + out +
                                                 " is the file that is read, in.ply, which would be replaced; give "
                                                 "another name");
    CHECK(file_text("in.ply") == before);
  }
  const ProgramResult result = run_hsi4d({"convert", "link.ply", "in.ply"});
  CHECK(result.status == 2);
  CHECK_THAT(result.err, Contains("in.ply is the file that is read, link.ply, which would be replaced"));
  CHECK(fault({.out = "copy.ply"}) == "no fault");
  CHECK(fault({.out = "copy.ply"}) == "no fault");  // another file of before is replaced, as ever
}

TEST_CASE("harmonics of degree 4 in a PLY are left out and counted") {
  const TemporaryFolder folder;
  std::string header = "ply\nformat ascii 1.0\nelement vertex 1\n", row;
  for (const char* name : {"x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2"}) {
    header += std::string("property float ") + name + "\n";
    row += "0.5 ";
  }
  for (int i = 0; i < 72; ++i) {  // 24 of a channel
    header += "property float f_rest_" + std::to_string(i) + "\n";
    row += std::to_string(i) + " ";
  }
  for (const char* name : {"opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"}) {
    header += std::string("property float ") + name + "\n";
    row += "1 ";
  }
  std::ofstream("in.ply") << header << "end_header\n" << row << "\n";
  const ProgramResult done = run_hsi4d({"convert", "in.ply", "out.ply"});
  CHECK(done.status == 0);
  CHECK(done.err == "hsi4d: warning: in.ply: Gaussians without their harmonics of degree 4: 1\n");
  CHECK_THAT(done.out, StartsWith("out.ply: 1 Gaussian, harmonics of degree 3, "));
  const Gaussians g = read_splats("out.ply").gaussians;
  REQUIRE(g.sh_degree == 3);
  REQUIRE(g.sh.size() == 48);
  CHECK(g.sh[0] == 0.5F);
  for (std::size_t k = 1; k < 16; ++k) {
    for (std::size_t c = 0; c < 3; ++c) CHECK(g.sh[3 * k + c] == static_cast<float>(24 * c + k - 1));
  }
  CHECK(g.opacity_logits[0] == 1);
}

TEST_CASE("what convert leaves out of a damaged file is told") {
  const TemporaryFolder folder;
  Gaussians g = plain_gaussians(3, 0);
  g.means[3] = NAN;
  g.log_scales[0] = -37;
  g.opacity_logits[0] = INFINITY;
  write_ply("in.ply", g);
  const ProgramResult done = run_hsi4d({"convert", "in.ply", "out.splat"});
  CHECK(done.status == 0);
  CHECK(done.err ==
        "hsi4d: warning: in.ply: 1 of 3 Gaussians are left out (a mean that is not finite: 1); log-scales held within "
        "±20: 1, opacity logits held within ±20: 1\n");
  CHECK(done.out == "out.splat: 2 Gaussians, harmonics of degree 0, 64 bytes\n");
  std::filesystem::resize_file("in.ply", std::filesystem::file_size("in.ply") - 1);
  const ProgramResult cut = run_hsi4d({"convert", "in.ply", "cut.splat"});
  CHECK(cut.status == 2);
  CHECK_THAT(cut.err, Contains("it was cut short, or its header is wrong"));
  CHECK_FALSE(std::filesystem::exists("cut.splat"));
}

TEST_CASE("render and gradients take any format, and draw what convert makes of it") {
  const TemporaryFolder folder;
  const SplatScene scene = random_splats(40, 5, {20, 15});
  const Gaussians g = scene.gaussians();
  write_ply("in.ply", g);
  write_camera("camera.json", scene.camera);
  for (const SplatFormat& format : splat_formats()) {
    const std::string name = "a" + format.ending;
    INFO(name);
    cli::convert_command({.in = "in.ply", .out = name});
    cli::convert_command({.in = name, .out = "plain.ply"});
    cli::RenderOptions options;
    options.shared.camera = "camera.json";
    options.shared.scene = name;
    options.out = "any.npz";
    cli::render_command(options);
    options.shared.scene = "plain.ply";
    options.out = "plain.npz";
    cli::render_command(options);
    const auto image = Npz::read("any.npz").array("image").as<double>();
    CHECK(image == Npz::read("plain.npz").array("image").as<double>());
    CHECK(*std::max_element(image.begin(), image.end()) > 0.1);
    cli::GradientsOptions gradients;
    gradients.shared = options.shared;
    gradients.shared.scene = name;
    gradients.target = "plain.npz";
    gradients.out = "gradients.npz";
    cli::gradients_command(gradients);
    CHECK(Npz::read("gradients.npz").array("means").shape()[0] == g.count());
  }
}

}  // namespace convert_command_test
