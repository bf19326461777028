#include <sstream>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "tests/support/program.h"
#include "tests/support/temporary_folder.h"

namespace scaling_command_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;

namespace {

/// The shipped benchmark with little of everything.
std::vector<std::string> small_scaling(const std::vector<std::string>& more) {
  std::vector<std::string> words = {"bench", "scaling", "--config",
                                    std::string(HSI4D_SOURCE_DIR) + "/configs/bench/paper_scale.json"};
  for (const char* setting : {"synthetic.size_px=48", "synthetic.scene_gaussians=2000",
                              "synthetic.avatar_gaussians=300", "synthetic.object_gaussians=100"})
    words.insert(words.end(), {"--set", setting});
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

}  // namespace

TEST_CASE("bench scaling measures along axes and draws them", "[run]") {
  const TemporaryFolder here;
  const ProgramResult result = run_hsi4d(small_scaling({"--axis", "avatar=300", "--axis", "threads=1,2", "--threads",
                                                        "2", "--repeats", "2", "--json", "m.json", "--plot", "m.svg"}));
  INFO(result.err);
  REQUIRE(result.status == 0);
  CHECK_THAT(result.err, Contains("points 6/6"));  // three times two: one is on both axes
  CHECK_THAT(result.out, Contains("avatar: Gaussians of the human, scene ") && Contains("threads 2\n") &&
                             Contains("threads: threads, scene "));
  std::istringstream text(file_text("m.json"));
  std::vector<nlohmann::json> costs;
  for (std::string line; std::getline(text, line);) {
    const nlohmann::json object = nlohmann::json::parse(line);
    if (object.contains("median_ms") && object["stage"] == "interaction") costs.push_back(object);
  }
  REQUIRE(costs.size() == 3);
  CHECK((costs[0]["axis"] == "avatar" && costs[0]["value"] == 300 && costs[0]["threads"] == 2));
  CHECK(costs[1]["threads"] == 1);
  CHECK(costs[2]["median_ms"] == costs[0]["median_ms"]);
  CHECK(costs[1]["pairs"] == costs[2]["pairs"]);
  CHECK(costs[1]["fragments"] == costs[2]["fragments"]);
  CHECK_THAT(file_text("m.svg"), Contains("<svg") && Contains("interaction") && Contains("</svg>"));
}

TEST_CASE("bench scaling tells of a value that cannot be before it measures") {
  const TemporaryFolder here;
  const ProgramResult result = run_hsi4d(small_scaling({"--axis", "scene=1000,600"}));
  CHECK(result.status == 2);
  CHECK_THAT(result.err,
             Contains("--set synthetic.scene_gaussians=600") && Contains("600 is out of range; allowed: 700 to"));
}

}  // namespace scaling_command_test
