// `hsi4d render --debug-pixel`: what it prints.
#include <cstdlib>
#include <filesystem>
#include <set>
#include <sstream>

#include "pipelines/cli/pixel_table.h"
#include "tests/pipelines/cli/render_files.h"

namespace debug_pixel_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

std::vector<std::string> words_of(const std::string& line) {
  std::istringstream stream(line);
  std::vector<std::string> words;
  for (std::string word; stream >> word;) words.push_back(word);
  return words;
}

/// The line that begins so, without its beginning.
std::string after(const std::vector<std::string>& lines, const std::string& start) {
  for (const std::string& line : lines) {
    if (line.starts_with(start)) return line.substr(start.size());
  }
  FAIL("no line begins with " << start);
  return {};
}

}  // namespace

TEST_CASE("debug-pixel prints the Gaussians of a pixel, whose sums are the image") {
  const Files files;
  for (const char* word : kWords) {
    INFO(word);
    cli::RenderOptions options = render_options("a.npz", word);
    options.pixels = {"18,12"};
    const std::vector<std::string> lines = lines_of(cli::render_command(options));
    CHECK(lines.front() == "pixel column 18, row 12: 4 Gaussians composited, front to back");
    CHECK(words_of(lines[1])[1] == "row");
    CHECK_THAT(lines[1], Catch::Matchers::Contains(" colour ") && Catch::Matchers::EndsWith("sum of weight x colour"));
    std::array<double, 3> sum{};
    double transmittance = 1, depth_before = 0;
    std::set<std::string> rows;
    for (std::size_t i = 2; i < 6; ++i) {  // # row depth uncapped alpha T weight r g b R G B
      const std::vector<std::string> cells = words_of(lines[i]);
      REQUIRE(cells.size() == 13);
      CHECK(cells[0] == std::to_string(i - 1));
      rows.insert(cells[1]);
      CHECK(std::stod(cells[2]) >= depth_before);
      depth_before = std::stod(cells[2]);
      const double alpha = std::stod(cells[4]), weight = std::stod(cells[6]);
      CHECK(cells[3] == cells[4]);
      CHECK(std::stod(cells[5]) == Approx(transmittance).epsilon(1e-5));
      CHECK(weight == Approx(transmittance * alpha).epsilon(1e-5));
      transmittance *= 1 - alpha;
      for (std::size_t c = 0; c < 3; ++c) {
        sum[c] += weight * std::stod(cells[7 + c]);
        CHECK(std::stod(cells[10 + c]) == Approx(sum[c]).epsilon(1e-4));
      }
    }
    CHECK(rows.count(std::to_string(kRejected)) == 0);  // rows are the file's
    CHECK(std::stoi(*rows.rbegin()) > static_cast<int>(kRejected));
    const std::vector<double> image = numbers("a.npz", "image");
    const std::vector<std::string> told = words_of(after(lines, "image: "));
    const std::string total = after(lines, "sum: ");
    const std::vector<std::string> summed = words_of(total.substr(total.find('=') + 1));
    for (std::size_t c = 0; c < 3; ++c) {
      const double value = image[3 * (12 * kWidth + 18) + c];
      CHECK(sum[c] + transmittance * 0.1 * static_cast<double>(c + 1) == Approx(value).epsilon(1e-4));
      CHECK(std::strtod(told[c].c_str(), nullptr) == Approx(value).epsilon(1e-5));
      CHECK(std::strtod(summed[c].c_str(), nullptr) == Approx(value).epsilon(1e-5));
    }
    CHECK(lines.back().starts_with("a.npz: 37 x 23 pixels"));
    const cli::RenderOptions without = render_options("b.npz", word);
    cli::render_command(without);
    CHECK(numbers("b.npz", "image") == image);  // looking changes nothing
  }
}

TEST_CASE("debug-pixel names files, caps, stops and what was nearly drawn") {
  const Files files;
  // An opaque wall in front of all else, through the ray of the pixel, and before it a small one six pixels beside.
  const Camera camera = test_camera();
  const auto on_ray = [&](double column, double depth) -> Vector3<double> {
    const Vector3<double> place((column + 0.5 - camera.cx) / camera.fx * depth, (12.5 - camera.cy) / camera.fy * depth,
                                depth);
    return transform_point(inverse(camera.camera_from_world), place);
  };
  Gaussians wall;
  for (const Vector3<double>& mean : {on_ray(18, 0.8), on_ray(24, 0.5)})
    for (int i = 0; i < 3; ++i) wall.means.push_back(static_cast<float>(mean[i]));
  wall.quats = {1, 0, 0, 0, 1, 0, 0, 0};
  wall.log_scales = {0, 0, 0, -4, -4, -4};
  wall.opacity_logits = {15, 2};
  wall.sh = {1, 1, 1, 1, 1, 1};
  write_ply("wall.ply", wall);
  for (const char* word : kWords) {
    INFO(word);
    cli::RenderOptions options = render_options("a.npz", word);
    options.objects = {"wall.ply"};
    options.pixels = {"18,12", "0,22"};
    options.shared.settings = {"render.alpha_cap=0.999", "render.transmittance_stop=0.01"};
    std::vector<std::string> lines = lines_of(cli::render_command(options));
    CHECK(lines.front() == "pixel column 18, row 12: 1 Gaussian composited, front to back");
    const std::vector<std::string> cells = words_of(lines[2]);
    REQUIRE(cells.size() == 16);
    CHECK(cells[1] == "wall.ply");
    CHECK(cells[2] == "0");
    CHECK(cells[3] == "0.8");
    CHECK(std::stod(cells[4]) > 0.9995);
    CHECK(cells[5] == "0.999");
    CHECK(cells[14] == "capped");
    CHECK(cells[15] == "stop");
    CHECK_THAT(after(lines, "skipped, alpha below render.alpha_min 0.00392157: 1; nearest miss: "),
               Catch::Matchers::StartsWith("row 1 of wall.ply, depth 0.5, alpha "));
    CHECK_THAT(after(lines, "stopped by render.transmittance_stop 0.01 after #1, behind which T is "),
               Catch::Matchers::Contains("; not looked at behind it: "));
    CHECK(after(lines, "pixel column 0").starts_with(", row 22: "));
    options.shared.settings.push_back("render.stop_rule=exclusive");
    lines = lines_of(cli::render_command(options));
    CHECK(lines.front() == "pixel column 18, row 12: 0 Gaussians composited, front to back");
    CHECK_THAT(
        after(lines, "stopped by render.transmittance_stop 0.01 before row 0 of wall.ply, depth 0.8, alpha 0.999"),
        Catch::Matchers::StartsWith(", behind which T would be 0.0"));
  }
}

TEST_CASE("a debug-pixel outside the image, or no pixel, is refused") {
  const Files files;
  cli::RenderOptions options = render_options("a.npz", "float");
  for (const std::string outside : {"37,0", "0,23", "-1,0", "0,-1"}) {
    options.pixels = {outside};
    CHECK(fault([&] { cli::render_command(options); }) ==
          "hsi4d render: --debug-pixel: pixel " + outside +
              " is not in the image; allowed: column,row from 0,0 to 36,22");
  }
  for (const std::string text : {"", "3", "3,", ",3", "3,4,5", "3,4 ", "3.5,1", "a,b", "99999999999,0"}) {
    options.pixels = {text};
    CHECK(fault([&] { cli::render_command(options); }) ==
          "hsi4d render: --debug-pixel: \"" + text + "\" is no pixel; allowed: column,row from 0,0 to 36,22");
  }
  CHECK_FALSE(std::filesystem::exists("a.npz"));
}

}  // namespace debug_pixel_test
