// The sweeps that come with the program.
#include <filesystem>
#include <iterator>
#include <map>
#include <set>
#include <string>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "optim/loss_term.h"
#include "pipelines/sweep/plan.h"
#include "tests/support/program.h"
#include "tests/support/temporary_folder.h"

namespace configs_test {

using namespace hsi4d;
using namespace hsi4d::test;
namespace fs = std::filesystem;

namespace {

fs::path shipped(const std::string& name) { return fs::path(HSI4D_SOURCE_DIR) / "configs" / name; }

/// What a resolved config says of the method, without what is of a clip, a seed or a sweep. A group at rate 0 stays, as
/// one that is not named does.
nlohmann::json method_of(const std::string& resolved) {
  nlohmann::json config = nlohmann::json::parse(resolved);
  for (const char* section :
       {"name", "seed", "threads", "log", "data", "chain", "sources", "body", "synthetic", "instance"})
    config.erase(section);
  for (auto& stage : config["stages"]) {
    nlohmann::json moving = nlohmann::json::object();
    for (const auto& [group, settings] : stage["optimize"].items()) {
      if (settings["lr"] != 0) moving[group] = settings;
    }
    stage["optimize"] = moving;
  }
  return config;
}

std::string resolved_file(const fs::path& file) {
  const std::vector<LossDescription> losses = descriptions_of(loss_terms());
  return resolved_config(load_run_config(file, {}, losses), losses);
}

/// The plan of a shipped sweep, made once: the largest takes seconds.
const SweepPlan& plan_of(const fs::path& sweep) {
  static std::map<fs::path, SweepPlan> plans;
  const auto found = plans.find(sweep);
  if (found != plans.end()) return found->second;
  return plans.emplace(sweep, plan_sweep(sweep, descriptions_of(loss_terms()))).first->second;
}

/// By block and name, what the ablations of a shipped sweep make of the method.
std::map<std::string, nlohmann::json> ablations_of(const std::string& sweep) {
  std::map<std::string, nlohmann::json> all;
  for (const SweepRun& run : plan_of(shipped("sweeps/" + sweep)).runs) {
    const std::string name = (run.block.empty() ? "" : run.block + ", ") + run.ablation;
    if (!all.contains(name)) all[name] = method_of(run.config);
  }
  return all;
}

/// Another reading of the paper: a row of the ablations, where its config differs from paper.json's, and how.
struct Reading {
  const char* name;
  const char* pointer;
  const char* word;  ///< or the end of a path
};

constexpr Reading kReadings[] = {
    {"increment_camera", "/camera/increment", "camera"},
    {"increment_world", "/camera/increment", "world"},
    {"center_pixels", "/stages/interaction/losses/center/unit", "pixels"},
    {"center_widths", "/stages/interaction/losses/center/unit", "widths"},
    {"center_l1", "/stages/interaction/losses/center/norm", "l1"},
    {"center_moves_all", "/stages/interaction/losses/center/moves", "all"},
    {"fit_sum", "/stages/refinement/losses/fit/joints", "sum"},
    {"smooth_mean", "/stages/refinement/losses/smooth/frames", "mean"},
    {"prior", "/stages/refinement/pose_weights", "/configs/pose_prior.npz"},
};

}  // namespace

TEST_CASE("every shipped sweep can be planned, and docs/sweeps.md tells its runs") {
  const TemporaryFolder here;
  const std::string docs = file_text(fs::path(HSI4D_SOURCE_DIR) / "docs" / "sweeps.md");
  int count = 0;
  for (const auto& entry : fs::directory_iterator(shipped("sweeps"))) {
    if (entry.path().extension() != ".json") continue;
    INFO(entry.path());
    const SweepPlan& plan = plan_of(entry.path());
    CHECK(plan.name == entry.path().stem().string());
    const std::string row = "\n| `" + plan.name + "` | " + std::to_string(distinct_runs(plan).size()) + " | ";
    INFO(row);
    CHECK(docs.find(row) != std::string::npos);
    ++count;
  }
  CHECK(count >= 1);
}

TEST_CASE("the sweeps of AnyInteraction have the clips that the paper scores: all but those of Bicycle and Truck") {
  const auto clips_of = [](const std::string& sweep) {
    std::map<std::string, std::set<std::string>> seeds;
    for (const SweepRun& run : plan_of(shipped("sweeps/" + sweep)).runs)
      if (run.ablation.empty() || run.ablation == "whole") seeds[run.clip].insert(run.seed);
    return seeds;
  };
  std::map<std::string, std::set<std::string>> statics, dynamics;
  for (const auto& entry : fs::directory_iterator(shipped("anyinteraction"))) {
    if (entry.path().extension() != ".json" || entry.path().stem() == "base") continue;
    const nlohmann::json instance = nlohmann::json::parse(file_text(entry.path()))["instance"];
    const std::string scene = instance["scene"], name = entry.path().stem().string();
    const std::set<std::string> seeds = {"0", "1", "2", "3", "4"};
    if (instance["object"] != "static") {
      dynamics[name] = seeds;
    } else if (scene != "Bicycle" && scene != "Truck") {
      statics[name] = seeds;
    }
  }
  CHECK(statics.size() == 11);
  CHECK(dynamics.size() == 9);
  CHECK(clips_of("anyinteraction_static.json") == statics);
  CHECK(clips_of("anyinteraction_dynamic.json") == dynamics);
  std::map<std::string, std::set<std::string>> both = statics;
  both.merge(dynamics);
  CHECK(clips_of("ablations.json") == both);
}

TEST_CASE(
    "the table of AnyInteraction has the paper's clips, by its schedule and by best.json without its refinement") {
  nlohmann::json best = method_of(resolved_file(shipped("best.json")));
  REQUIRE(best["stages"].erase("refinement") == 1);
  best["passes"]["count"] = 1;
  best["stages"]["interaction"]["iterations"] = 200;
  best["stages"]["interaction"]["losses"]["grip"]["weight"] = 0;
  best["stages"]["interaction"]["optimize"].erase("object_light");
  std::map<std::string, nlohmann::json> methods = {
      {"paper", method_of(resolved_file(shipped("anyinteraction/base.json")))}, {"best", best}};
  std::map<std::string, std::set<std::string>> clips, datasets;
  for (const SweepRun& run : plan_of(shipped("sweeps/anyinteraction_table.json")).runs) {
    INFO(run.block << ", " << run.clip << ", " << run.seed);
    clips[run.block].insert(run.clip);
    datasets[run.clip + run.seed].insert(run.dataset);
    CHECK(nlohmann::json::diff(methods[run.block.substr(0, run.block.find('_'))], method_of(run.config)).dump() ==
          "[]");
  }
  for (const char* kind : {"static", "dynamic"}) {
    std::set<std::string> of_paper;
    for (const SweepRun& run : plan_of(shipped(std::string("sweeps/anyinteraction_") + kind + ".json")).runs)
      of_paper.insert(run.clip);
    CHECK(clips[std::string("paper_") + kind] == of_paper);
    CHECK(clips[std::string("best_") + kind] == of_paper);
  }
  CHECK(clips.size() == 4);
  for (const auto& [of, made] : datasets) CHECK(made.size() == 1);  // the same video of the same seed
}

TEST_CASE("the sweep of the ablations and the configs of them leave out the same", "[release]") {
  std::map<std::string, nlohmann::json> in_sweep = ablations_of("ablations.json");
  CHECK(in_sweep["whole"] == method_of(resolved_file(shipped("best.json"))));
  CHECK(in_sweep["paper, whole"] == method_of(resolved_file(shipped("paper.json"))));
  std::size_t configs = 0;
  for (const auto& entry : fs::directory_iterator(shipped("ablations"))) {
    if (entry.path().extension() != ".json") continue;
    const std::string name = entry.path().stem().string(), in_block = name == "no_depth" ? "paper, " + name : name;
    INFO(name);
    ++configs;
    REQUIRE(in_sweep.contains(in_block));
    const nlohmann::json method = method_of(resolved_file(entry.path()));
    CHECK(nlohmann::json::diff(in_sweep[in_block], method).dump() == "[]");
    CHECK(method != in_sweep[in_block == name ? "whole" : "paper, whole"]);
  }
  CHECK(in_sweep.size() == configs + 5 + std::size(kReadings));  // two to compare with, passes, sigmas, constant_rates
  for (const auto& [name, method] : ablations_of("ablation_table.json")) {
    INFO(name);
    REQUIRE(in_sweep.contains(name));
    CHECK(nlohmann::json::diff(in_sweep[name], method).dump() == "[]");
  }
}

TEST_CASE("the ablations of paper.json are its readings, each a word away", "[release]") {
  std::map<std::string, nlohmann::json> in_sweep = ablations_of("ablations.json");
  const nlohmann::json& paper = in_sweep["paper, whole"];
  for (const Reading& reading : kReadings) {
    INFO(reading.name);
    REQUIRE(in_sweep.contains(std::string("paper, ") + reading.name));
    const nlohmann::json changes = nlohmann::json::diff(paper, in_sweep[std::string("paper, ") + reading.name]);
    REQUIRE(changes.size() == 1);
    CHECK(changes[0]["op"] == "replace");
    CHECK(changes[0]["path"] == reading.pointer);
    const std::string value = changes[0]["value"];
    CHECK(value.ends_with(reading.word));
    CHECK((value == reading.word || fs::exists(value)));
  }
  const nlohmann::json rates = nlohmann::json::diff(paper, in_sweep["paper, constant_rates"]);
  CHECK(rates.size() == 7);  // of all groups of the second stage but the color net
  for (const nlohmann::json& change : rates) {
    CHECK(change["path"].get<std::string>().ends_with("/lr_final_share"));
    CHECK(change["value"] == 1);
  }
}

TEST_CASE("the smoke sweep is computed", "[full]") {
  const TemporaryFolder here;
  const std::string file = shipped("sweeps/smoke.json").string();
  CHECK(run_hsi4d({"check", file}).out == file + ": OK, a sweep of 4 runs\n");
  const ProgramResult sweep = run_hsi4d({"sweep", file});
  INFO(sweep.err);
  CHECK(sweep.status == 0);
  CHECK(sweep.out.find("\n4 runs: 4 done\n") != std::string::npos);
  CHECK(fs::exists("runs/smoke/report.html"));
}

}  // namespace configs_test
