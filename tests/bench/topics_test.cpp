#include "bench/topics.h"

#include <filesystem>

#include <catch2/catch.hpp>

#include "tests/support/program.h"

namespace topics_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;

namespace {

std::string refusal(std::vector<std::string> words) {
  words.insert(words.begin(), "bench");
  const ProgramResult result = run_hsi4d(words);
  CHECK(result.status == 2);
  CHECK(result.out.empty());
  return result.err;
}

std::string help(const std::string& topic) {
  const ProgramResult result = run_hsi4d({"bench", topic, "--help"});
  CHECK(result.status == 0);
  CHECK(result.err.empty());
  return result.out;
}

}  // namespace

TEST_CASE("bench refuses options of another topic, and tells whose they are and which there are") {
  const TemporaryFolder here;
  CHECK(refusal({"rasterize", "--plot", "f.svg"}) ==
        "hsi4d bench rasterize: --plot is of stages, scaling and pareto alone; here there are --workload, --threads, "
        "--repeats and --json\n");
  CHECK(refusal({"--plot", "f.svg"}) ==
        "hsi4d bench: --plot is of stages, scaling and pareto alone; without a topic there are --workload, --threads, "
        "--repeats and --json\n");
  CHECK_THAT(refusal({"stages", "--repeats", "3"}),
             Contains("--repeats is of rasterize, skinning, color_net, tape, scaling and pareto alone"));
  CHECK_THAT(refusal({"scaling", "--compare"}), Contains("hsi4d bench scaling: --compare is of stages alone; "));
  CHECK_THAT(refusal({"scaling", "--workload", "small"}), Contains("--workload is of rasterize, skinning, "));
  CHECK_THAT(refusal({"skinning", "--set", "seed=1"}), Contains("--set is of stages, scaling and pareto alone; "));
  CHECK_THAT(refusal({"pixel_filter", "--csv", "f.csv"}), Contains("--csv is of pareto alone; "));
  CHECK_FALSE(std::filesystem::exists("f.svg"));
}

TEST_CASE("the help of a topic has its own options alone") {
  const TemporaryFolder here;
  for (const cli::BenchTopic& topic : cli::bench_topics()) {
    const std::string text = help(topic.name);
    INFO(text);
    CHECK_THAT(text, Contains(topic.summary) && Contains("bench " + topic.name) && Contains("--json") &&
                         !Contains("TOPIC") && !Contains("[]") && !Contains("Of "));
    CHECK((text.find("--axis") != std::string::npos) == (topic.name == "scaling"));
    CHECK((text.find("--front") != std::string::npos) == (topic.name == "pareto"));
    CHECK((text.find("--height") != std::string::npos) == (topic.name == "pixel_filter"));
    CHECK((text.find("--compare") != std::string::npos) == (topic.name == "stages"));
  }
  CHECK_THAT(help("pareto"), Contains("configs/bench/pareto_tracking.json") && !Contains("paper_scale"));
  const ProgramResult all = run_hsi4d({"bench", "--help"});
  CHECK_THAT(all.out, Contains("TOPIC") && Contains("Of stages, scaling and pareto: file for a picture") &&
                          Contains("File for the measurements, one JSON object a line"));
}

}  // namespace topics_test
