#include "pipelines/record/gradient_table.h"

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "core/check.h"
#include "tests/support/tiny_run.h"

namespace gradient_table_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

const std::string kLines =
    R"({"frame": 1, "stage": "a", "iteration": 0, "gradient_shares": {"transl": {"fit": {"norm": 1, "share": 0.25, "cosine": 1}, "smooth": {"norm": 3, "share": 0.75, "cosine": -0.5}}}})"
    "\n"
    R"({"frame": 1, "stage": "a", "iteration": 1})"
    "\n"
    R"({"frame": 1, "stage": "b", "iteration": 0, "gradient_shares": {"transl": {"fit": {"norm": 1, "share": 1, "cosine": 1}}}})"
    "\n"
    R"({"frame": 2, "stage": "a", "iteration": 0, "gradient_shares": {"transl": {"fit": {"norm": 2, "share": 0.75, "cosine": 0}, "smooth": {"norm": 3, "share": 0.25, "cosine": 0.25}}, "pose": {"fit": {"norm": 0, "share": 0, "cosine": 0}}}})"
    "\n";

}  // namespace

TEST_CASE("shares of the gradient are averaged over the lines of a stage") {
  const std::vector<MeanGradientShare> means = mean_gradient_shares(kLines, "a", "metrics.jsonl");
  REQUIRE(means.size() == 3);
  CHECK(means[0].group == "transl");
  CHECK(means[0].term == "fit");
  CHECK(means[0].share == 0.5);
  CHECK(means[0].cosine == 0.5);
  CHECK(means[0].evaluations == 2);
  CHECK(means[1].cosine == -0.125);
  CHECK(means[2].group == "pose");
  CHECK(means[2].evaluations == 1);
  CHECK(mean_gradient_shares(kLines, "c", "metrics.jsonl").empty());
  CHECK_THROWS_WITH(mean_gradient_shares("\n{\"stage\": \"a\", \"gradient_shares\": {\"x\": {\"y\": {}}}}\n", "a", "m"),
                    "m:2: /gradient_shares/x/y: there is no \"share\"");
}

TEST_CASE("shares of the gradient as a table, and in summary.json and back") {
  RunSummary summary;
  summary.name = "x";
  summary.surface = "room.ply";
  summary.metrics.push_back({"a", 1, 2, {}, mean_gradient_shares(kLines, "a", "metrics.jsonl")});
  summary.metrics.push_back({"b", 1, 2, {}, {}});
  CHECK(gradient_table(summary) ==
        "shares of the gradient, and cosines with the whole (means over the iterations looked at)\n"
        "stage a            fit          smooth\n"
        "transl   50.0 % (0.50)  50.0 % (-0.12)\n"
        "pose      0.0 % (0.00)               -\n");
  const RunSummary read = parse_summary(summary_json(summary), "summary.json");
  CHECK(read.surface == "room.ply");
  REQUIRE(read.metrics.size() == 2);
  CHECK(gradient_table(read) == gradient_table(summary));
  CHECK(read.metrics[0].gradient_shares[0].evaluations == 2);
  CHECK(read.metrics[1].gradient_shares.empty());
  CHECK(gradient_table(RunSummary{}).empty());
}

TEST_CASE("measuring shares changes no bit of a run's result, and both files have them", "[release]") {
  const TemporaryFolder folder;
  const auto run = [&](const char* name, const std::vector<std::string>& overrides) {
    execute_tiny(tiny_config(overrides), name);
    return std::pair{file_text(std::string(name) + "/motion.npz"), file_text(std::string(name) + "/objects.npz")};
  };
  const auto off = run("off", {});
  const auto on = run("on", {"stages.camera.gradient_shares=3", "stages.interaction.gradient_shares=4"});
  CHECK(on == off);
  std::size_t with_shares = 0;
  for (const nlohmann::json& line : metrics_of("on")) {
    const int every = line["stage"] == "camera" ? 3 : 4;
    CHECK(line.contains("gradient_shares") == (line["iteration"].get<int>() % every == 0));
    if (!line.contains("gradient_shares")) continue;
    ++with_shares;
    for (const auto& [group, terms] : line["gradient_shares"].items()) {
      double sum = 0;
      for (const auto& [term, numbers] : terms.items()) sum += numbers["share"].get<double>();
      CHECK(sum == Approx(1));
    }
  }
  CHECK(with_shares == 3 * (3 + 3));
  const std::vector<nlohmann::json> lines_on = metrics_of("on"), lines_off = metrics_of("off");
  REQUIRE(lines_on.size() == lines_off.size());
  for (std::size_t i = 0; i < lines_on.size(); ++i) {
    nlohmann::json a = lines_on[i], b = lines_off[i];
    for (nlohmann::json* line : {&a, &b}) {
      line->erase("seconds");
      line->erase("gradient_shares");
    }
    CHECK(a == b);  // losses and all counters
    CHECK_FALSE(lines_off[i].contains("gradient_shares"));
  }
  const nlohmann::json summary = json_of("on/summary.json");
  CHECK(summary["metrics"][0]["gradient_shares"]["camera"]["masked_l2"]["share"] == Approx(1));
  CHECK(summary["metrics"][1]["gradient_shares"]["transl"]["photometric"]["evaluations"] == 9);
  CHECK_FALSE(json_of("off/summary.json")["metrics"][1].contains("gradient_shares"));
}

}  // namespace gradient_table_test
