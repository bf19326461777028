#include <filesystem>

#include <catch2/catch.hpp>

#include "bench/list.h"
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
  std::vector<std::string> words = {"bench", topic, "--help"};
  if (topic.empty()) words.erase(words.begin() + 1);
  const ProgramResult result = run_hsi4d(words);
  CHECK(result.status == 0);
  CHECK(result.err.empty());
  return result.out;
}

}  // namespace

TEST_CASE("bench refuses options of another topic, and tells which there are") {
  const TemporaryFolder here;
  CHECK(refusal({"rasterize", "--plot", "f.svg"}) ==
        "hsi4d bench rasterize: there is no option \"--plot\"; known: --help, --workload, --threads, --repeats, "
        "--json\n");
  CHECK(refusal({"--plot", "f.svg"}) ==
        "hsi4d bench: there is no option \"--plot\"; known: --help, --threads, --repeats, --json\n");
  CHECK_THAT(refusal({"tape", "--threads", "2"}), Contains("there is no option \"--threads\""));
  CHECK_THAT(refusal({"rasterise"}), Contains("rasterize"));
  CHECK_THAT(refusal({"--repeats", "3", "skinning"}), Contains("options stand behind the topic"));
  CHECK_FALSE(std::filesystem::exists("f.svg"));
}

TEST_CASE("the help of a topic has its own options alone") {
  const TemporaryFolder here;
  const std::string all = help("");
#define HSI4D_BENCH_TOPIC(name) #name,
  for (const std::string topic : {HSI4D_BENCH_TOPICS}) {
#undef HSI4D_BENCH_TOPIC
    const std::string text = help(topic);
    INFO(text);
    CHECK_THAT(all, Contains(topic));
    CHECK_THAT(text, Contains("bench " + topic) && Contains("--json") && !Contains("[]"));
    CHECK((text.find("--axis") != std::string::npos) == (topic == "scaling"));
    CHECK((text.find("--front") != std::string::npos) == (topic == "pareto"));
    CHECK((text.find("--height") != std::string::npos) == (topic == "pixel_filter"));
    CHECK((text.find("--compare") != std::string::npos) == (topic == "stages"));
  }
  CHECK_THAT(help("pareto"), Contains("configs/bench/pareto_tracking.json") && !Contains("paper_scale"));
}

}  // namespace topics_test
