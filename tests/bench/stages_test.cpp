#include "bench/stages.h"

#include <map>
#include <sstream>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "core/file.h"
#include "core/text.h"
#include "tests/bench/rows.h"
#include "tests/support/program.h"
#include "tests/support/temporary_folder.h"

namespace stages_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
using Catch::Matchers::Equals;

namespace {

const std::string kConfigs = std::string(HSI4D_SOURCE_DIR) + "/configs/bench/";
const std::string kConfig = kConfigs + "paper_scale.json";

/// A shipped benchmark with little of everything.
std::vector<std::string> small_bench(const std::string& config = kConfig) {
  std::vector<std::string> words = {"bench",  "stages",     "--config", config,      "--out",     "out",
                                    "--json", "costs.json", "--plot",   "costs.svg", "--threads", "2"};
  for (const char* setting :
       {"synthetic.frames=3", "synthetic.size_px=48", "synthetic.scene_gaussians=3000",
        "synthetic.avatar_gaussians=500", "synthetic.object_gaussians=200", "stages.camera.iterations=4",
        "stages.interaction.iterations=34", "stages.refinement.iterations=6"}) {
    words.insert(words.end(), {"--set", setting});
  }
  return words;
}

std::vector<nlohmann::json> lines_of(const std::string& file) {
  std::istringstream text(read_text_file(file));
  std::vector<nlohmann::json> lines;
  for (std::string line; std::getline(text, line);) lines.push_back(nlohmann::json::parse(line));
  return lines;
}

}  // namespace

TEST_CASE("bench stages tells where the time of every stage goes", "[run]") {
  const TemporaryFolder here;
  std::vector<std::string> words = small_bench();
  words.push_back("--curvature");
  const ProgramResult first = run_hsi4d(words);
  INFO(first.err);
  REQUIRE(first.status == 0);
  for (const char* part : {"camera, ms an iteration", "d_ssim", "image_difference", "of composite:", "one curvature of",
                           "optimisation", "world MPJPE"})
    CHECK_THAT(first.out, Contains(part));

  std::map<std::string, nlohmann::json> stages;
  std::map<std::string, double> of_parts;
  const std::vector<nlohmann::json> lines = lines_of("costs.json");
  for (const nlohmann::json& line : lines) {
    if (line.contains("operator")) {
      of_parts[line["stage"]] += line["forward_ms"].get<double>() + line["backward_ms"].get<double>();
    } else if (line.contains("stage")) {
      stages[line["stage"]] = line;
    }
  }
  REQUIRE(stages.size() == 3);
  CHECK(stages["camera"]["iterations"] == 2 * 4);
  CHECK(stages["interaction"]["iterations"] == 2 * 34);
  CHECK(stages["refinement"]["iterations"] == 6);
  for (const auto& [name, stage] : stages) {
    INFO(name);
    check_bench_row(stage);
    CHECK(stage["threads"] == 2);
    CHECK(of_parts[name] > 0);
    // Whatever the clock does: the parts lie in the stage, with the run that ends it.
    CHECK(of_parts[name] * stage["iterations"].get<double>() <= 1e3 * stage["seconds"].get<double>());
    CHECK(stage["tape_bytes"] > 0);
    CHECK(stage["name"] == "stages/" + name);
    CHECK(stage["repeats"] == (name == "refinement" ? 1 : 2));  // frames
    CHECK(stage.contains("mfragments_per_s") == stage.contains("fragments"));
  }
  CHECK(stages["camera"]["tiles_of_image"] == 9);
  CHECK(stages["camera"]["pixels"] == 48 * 48);
  CHECK(stages["interaction"]["tiles"].get<double>() <= 9);
  CHECK(stages["interaction"]["dirty_tiles"].get<double>() <= 9);
  CHECK_FALSE(stages["refinement"].contains("tiles"));
  CHECK(stages["camera"]["curvature_numbers"] == 6);
  CHECK(stages["camera"]["curvature_movers"] == 1);
  CHECK(stages["interaction"]["curvature_movers"] > 10);
  for (const char* stage : {"camera", "interaction"}) {
    double steps = 0;
    for (const auto& [name, ms] : stages[stage]["curvature_steps_ms"].items()) steps += ms[1].get<double>();
    CHECK(steps > 0);
  }
  CHECK(lines.back()["peak_memory_bytes"] > 0);
  CHECK(lines.back()["name"] == "stages");
  CHECK_THAT(lines.back()["machine"]["cpu"].get<std::string>(), !Equals(""));
  CHECK_THAT(read_text_file("costs.svg"), Contains("<svg") && Contains("interaction") && Contains("</svg>"));

  const ProgramResult again = run_hsi4d(small_bench());  // of the dataset that is there
  REQUIRE(again.status == 0);
  CHECK_THAT(again.out, Contains("out/run-2") && !Contains("one curvature of"));
  std::vector<std::string> other = small_bench();
  other.insert(other.end(), {"--set", "synthetic.seed=7"});
  const ProgramResult refused = run_hsi4d(other);
  CHECK(refused.status == 2);
  CHECK_THAT(refused.err, Contains("the dataset was made with other settings than these"));
}

TEST_CASE("the tape's own time is told where colours are held between iterations too", "[run]") {
  const TemporaryFolder here;
  const ProgramResult result = run_hsi4d(small_bench(kConfigs + "fast_scale.json"));
  INFO(result.err);
  REQUIRE(result.status == 0);
  int told = 0;
  for (const nlohmann::json& line : lines_of("costs.json")) {
    const std::string stage = line.value("stage", "");
    if (line.value("operator", "") != "the tape itself" || stage.starts_with("refinement")) continue;
    INFO(line.dump());
    CHECK(line["forward_ms"] > 0);
    CHECK(line["backward_ms"] > 0);
    ++told;
  }
  CHECK(told == 3);  // camera and both passes of the interaction
}

TEST_CASE("the first iteration of a stage weighs once, however many there are") {
  StageProfile profile;
  profile.stage = "interaction";
  profile.frame = 1;
  profile.iterations = 20;
  profile.first_seconds = 0.3;
  profile.iteration_seconds = 0.3 + 19 * 0.1;
  std::vector<StageCost> stages;
  for (int frame = 0; frame < 2; ++frame) add_profile(profile, stages);
  REQUIRE(stages.size() == 1);
  CHECK(stages[0].ms_each() == Approx(110));
  CHECK(stages[0].ms_each_of(20) == Approx(110));
  CHECK(stages[0].ms_each_of(200) == Approx(101));
  CHECK(stages[0].ms_each_of(1) == Approx(300));
}

TEST_CASE("allocations are those of iterations in the second half, where a stage comes so far") {
  std::int64_t asked = 0;
  StageProfile told;
  const StageWatch watch{[&told](const StageProfile& profile) { told = profile; }, [&asked] { return asked += 3; }};
  for (const Index ran : {3, 7}) {
    StageProbe probe(&watch);
    for (Index i = 0; i < ran; ++i) {
      IterationReport report;
      report.iteration = i;
      report.iterations = 10;
      probe.iteration_ended(report, nullptr);
      probe.iteration_begins();
    }
    StageResult result;
    result.iterations = ran;
    probe.stage_ended(result, {});
    CHECK(told.counted == (ran == 3 ? 0 : 2));
    CHECK(told.allocations == 3 * told.counted);
  }
}

TEST_CASE("bench stages tells what all skips together save", "[run]") {
  const TemporaryFolder here;
  std::vector<std::string> words = small_bench();
  words.emplace_back("--compare");
  const ProgramResult result = run_hsi4d(words);
  INFO(result.err);
  REQUIRE(result.status == 0);
  CHECK_THAT(result.out, Contains("with skips") && Contains("whole run"));
  CHECK(std::filesystem::exists("out/run-2"));
  std::map<std::string, nlohmann::json> compared;
  for (const nlohmann::json& line : lines_of("costs.json")) {
    if (line.contains("ratio")) compared[line.value("stage", "run")] = line;
  }
  REQUIRE(compared.size() == 3);  // the stage over the sequence draws nothing
  for (const auto& [name, entry] : compared) CHECK(entry["ratio"] > 0);
  CHECK(compared["run"]["seconds_without_skips"] > 0);
  for (const char* stage : {"camera", "interaction"}) {
    const nlohmann::json &with = compared[stage]["counters"], &without = compared[stage]["counters_without_skips"];
    for (const auto& [counter, count] : with.items()) {
      INFO(stage << ": " << counter);
      CHECK(count <= without[counter]);
    }
    for (const char* counter : {"forward_nodes", "backward_nodes", "adjoint_numbers"})
      CHECK(with[counter] < without[counter]);
  }
  const nlohmann::json& interaction = compared["interaction"];
  CHECK(interaction["counters"]["fragments"] < interaction["counters_without_skips"]["fragments"]);
}

}  // namespace stages_test
