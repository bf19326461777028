#include "pipelines/sweep/selection.h"

#include <filesystem>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "tests/support/made_sweep.h"

namespace selection_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
using Indices = std::vector<std::size_t>;

namespace {

/// The runs that a path names.
Indices chosen(const std::string& path) {
  const std::optional<SweepSelection> selection = select_sweep_runs(path);
  REQUIRE(selection);
  return selection->runs;
}

std::string refusal(const std::string& path) {
  try {
    select_sweep_runs(path);
  } catch (const UserError& error) {
    return error.what();
  }
  return "";
}

}  // namespace

TEST_CASE("runs of a sweep go by its folder, their names, their row's name, or parts of it") {
  MadeSweep sweep;
  sweep.finish_all();
  CHECK(chosen("made").size() == 12);
  CHECK(chosen("made/").size() == 12);
  CHECK(chosen("made/a, plain, seed 1") == Indices{1});
  CHECK(chosen("made/plain") == Indices{0, 1, 2, 3, 4, 5});
  CHECK(chosen("made/seed 2,a") == Indices{2, 8});
  CHECK(chosen("made/ablation=other, clip=b") == Indices{9, 10, 11});
  CHECK(chosen("made/seed=0") == Indices{0, 3, 6, 9});
  const std::optional<SweepSelection> one = select_sweep_runs("made/a, plain, seed 1");
  CHECK(one->name(1) == "a, plain, seed 1");
  CHECK(one->folder(1) == std::filesystem::path("made") / "runs" / sweep.id(1));
  CHECK(one->axes == std::set<std::string>{"ablation", "clip", "seed"});
  CHECK(select_sweep_runs("made/plain")->axes == std::set<std::string>{"ablation"});
  CHECK(select_sweep_runs("made")->axes.empty());
}

TEST_CASE("what is there under a path is no name in a sweep, and what leads into none is none") {
  MadeSweep sweep;
  sweep.finish_all();
  CHECK_FALSE(select_sweep_runs("made/runs/" + sweep.id(0)));
  CHECK_FALSE(select_sweep_runs("made/configs"));
  CHECK_FALSE(select_sweep_runs("elsewhere/plain"));
  CHECK_FALSE(select_sweep_runs("plain"));
}

TEST_CASE("runs that are not done are counted, and no name stands for these alone") {
  MadeSweep sweep;
  sweep.finish(0, 10);
  sweep.finish(7, 12);
  const std::optional<SweepSelection> all = select_sweep_runs("made");
  CHECK(all->runs == Indices{0, 7});
  CHECK(all->named.size() == 12);
  CHECK(all->not_done == 10);
  CHECK(refusal("made/b") == "made/b: none of 6 runs is done; hsi4d report made tells how they stand");
}

TEST_CASE("names that a sweep does not have are refused with those that it has") {
  MadeSweep sweep;
  sweep.finish_all();
  CHECK(refusal("made/plane") ==
        "made/plane: is not there, and the sweep in made has no run with \"plane\"; known: a, plain, seed 0, seed 1, "
        "seed 2, b, other; did you mean \"plain\"?");
  CHECK_THAT(refusal("made/plain, seed 9"), Contains("has no run with \"seed 9\""));
  CHECK(refusal("made/a, b") == "made/a, b: the sweep in made has runs with each of these, and none with all of them");
}

TEST_CASE("values of axes are named by the last part of their key, texts without quotes") {
  MadeSweep sweep([](SweepPlan& plan) {
    plan.compare.clear();
    plan.runs.resize(4);
    const char* const numbers[] = {"50", "100", "50", "100"};
    for (std::size_t i = 0; i < 4; ++i) {
      plan.runs[i].ablation.clear();
      plan.runs[i].clip.clear();
      plan.runs[i].seed = "0";
      plan.runs[i].values = {{"stages.interaction.iterations", numbers[i]},
                             {"color_net.use", i < 2 ? "\"on\"" : "\"off\""}};
    }
  });
  sweep.finish_all();
  CHECK(chosen("made/iterations 50") == Indices{0, 2});
  CHECK(chosen("made/iterations=100") == Indices{1, 3});
  CHECK(chosen("made/stages.interaction.iterations=100, use=off") == Indices{3});
  CHECK(chosen("made/iterations 50, use on") == Indices{0});
  const SweepRun& run = sweep.plan().runs[0];
  CHECK(name_without_axes(run, {"color_net.use"}) == "iterations 50, seed 0");
  CHECK(name_without_axes(run, {"color_net.use", "stages.interaction.iterations", "seed"}) == "");
}

TEST_CASE("a run that several combinations come to is named once") {
  MadeSweep sweep([](SweepPlan& plan) { plan.runs[6].id = plan.runs[0].id; });
  sweep.finish_all();
  CHECK(chosen("made/a, seed 0") == Indices{0});
  CHECK(chosen("made/other, a, seed 0") == Indices{6});
}

}  // namespace selection_test
