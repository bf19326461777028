#include <filesystem>
#include <sstream>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "splat/files/io_ply.h"
#include "tests/bench/rows.h"
#include "tests/support/program.h"
#include "tests/support/temporary_folder.h"

namespace pareto_command_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;

namespace {

/// Three Gaussians in a row.
void write_few(const std::string& path) {
  Gaussians g;
  g.means = {-1, 0, 0, 0, 0, 0, 1, 0, 0};
  for (int n = 0; n < 3; ++n) {
    for (const float part : {1.0f, 0.1f, 0.2f, 0.3f}) g.quats.push_back(part);
    for (const float part : {-1.5f, -2.0f, -2.5f}) g.log_scales.push_back(part);
    g.opacity_logits.push_back(1);
    for (const float part : {0.9f, 0.3f, -0.2f}) g.sh.push_back(part);
  }
  write_ply(path, g);
}

}  // namespace

TEST_CASE("bench pareto measures the Gaussians of a file and writes tables and a picture") {
  const TemporaryFolder here;
  write_few("few.ply");
  const ProgramResult result =
      run_hsi4d({"bench", "pareto", "--scene", "few.ply", "--knob", "tile", "--knob", "quality", "--repeats", "1",
                 "--seeds", "0", "--json", "m.json", "--csv", "m.csv", "--plot", "m.svg"});
  INFO(result.err);
  REQUIRE(result.status == 0);
  CHECK_THAT(result.err, Contains("settings 5/5"));
  CHECK_THAT(result.out, Contains("few.ply: 3 Gaussians, 16384 pixels\n") && Contains("tile 8") &&
                             Contains("front, few.ply\n") && !Contains("reconstruction"));
  std::istringstream text(file_text("m.json"));
  std::vector<nlohmann::json> rows;
  for (std::string line; std::getline(text, line);) rows.push_back(nlohmann::json::parse(line));
  REQUIRE(rows.size() == 5);
  for (const nlohmann::json& row : rows) check_bench_row(row);
  CHECK(rows[4]["name"] == "pareto/few.ply/tile 8");
  CHECK((rows[4]["threads"] == 1 && rows[4].contains("mfragments_per_s") && rows[4]["pixels"] == 128 * 128));
  CHECK((rows[0]["knob"] == "quality" && rows[0]["value"] == "default" && rows[0]["time_ratio"] == 1));
  CHECK(rows[0]["psnr_db"] > 40);
  CHECK(rows[0]["fragments"] > 100);
  CHECK(rows[3]["value"] == "reference");
  CHECK(rows[3]["psnr_db"] > 120);
  CHECK(rows[4]["knob"] == "tile");
  CHECK_THAT(file_text("m.csv"), Contains("\nfew.ply,tile,8,own,3,16384,"));
  CHECK_THAT(file_text("m.svg"), Contains("<svg") && Contains(">accurate</text>") && Contains("</svg>"));
}

TEST_CASE("bench pareto tells what it does not know before it measures") {
  const TemporaryFolder here;
  const auto error_of = [](std::vector<std::string> words) {
    words.insert(words.begin(), {"bench", "pareto"});
    const ProgramResult result = run_hsi4d(words);
    CHECK(result.status == 2);
    return result.err;
  };
  CHECK_THAT(
      error_of({"--knob", "alpha_mim"}),
      Contains("hsi4d bench pareto: no knob \"alpha_mim\"; known: quality, alpha_min, transmittance_stop, "
               "alpha_cap, footprint, precision, tile, sh_degree, product, depth_key, isa, threads; did you mean "
               "\"alpha_min\"?"));
  CHECK_THAT(error_of({"--workload", "garden"}), Contains("no workload \"garden\"; known: sparse, dense"));
  CHECK_THAT(error_of({"--scene", "none.ply"}), Contains("none.ply"));
  CHECK_THAT(error_of({"--seeds", "101"}), Contains("--seeds"));
  CHECK_THAT(error_of({"--workload", "empty", "--config", "none.json"}), Contains("none.json"));
  std::filesystem::create_directory("there");
  const std::string config = std::string(HSI4D_SOURCE_DIR) + "/configs/bench/pareto_tracking.json";
  for (const std::string& said :
       {error_of({"--workload", "empty", "--seeds", "1", "--config", config, "--out", "there"}),
        error_of({"--workload", "empty", "--seeds", "0", "--json", "good", "--csv", "there"})}) {
    CHECK_THAT(said, Contains("there: ") && !Contains("settings"));
  }
  CHECK_FALSE(std::filesystem::exists("good"));
  for (const auto& left : std::filesystem::directory_iterator(".")) CHECK(left.path().extension() != ".tmp");
  Gaussians none;
  write_ply("none_in.ply", none);
  CHECK_THAT(error_of({"--scene", "none_in.ply"}),
             Contains("none_in.ply: has no Gaussians, of which hsi4d bench pareto needs one or more"));
}

}  // namespace pareto_command_test
