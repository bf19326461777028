#include "pipelines/sweep/halving.h"

#include <algorithm>

#include <catch2/catch.hpp>

#include "core/random.h"
#include "pipelines/sweep/local.h"
#include "pipelines/sweep/slurm.h"
#include "tests/support/made_sweep.h"

namespace halving_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
namespace fs = std::filesystem;

namespace {

constexpr std::size_t kPoints = 8, kSeeds = 2, kRungs = 3;

/// Where the run of a point is in the plan.
std::size_t run_at(std::size_t rung, std::size_t point, std::size_t seed) {
  return (rung * kPoints + point) * kSeeds + seed;
}

/// A search over eight points of two seeds in three rungs.
void make_search(SweepPlan& plan) {
  plan.compare.clear();
  plan.runs.clear();
  plan.searches = {{"", "mpjpe_mm", {{"render.blur", false}}, {"stages.camera.iterations"}, 2}};
  for (std::size_t i = 0; i < kRungs * kPoints * kSeeds; ++i) {
    SweepRun run;
    run.id = std::string(i < 10 ? 15 : 14, '0') + std::to_string(i);
    run.seed = std::to_string(i % kSeeds);
    run.rung = i / (kPoints * kSeeds);
    run.values = {{"stages.camera.iterations", std::to_string(10 << run.rung)},
                  {"render.blur", "0." + std::to_string(1 + i / kSeeds % kPoints)}};
    run.config = "{}";
    plan.runs.push_back(run);
  }
}

/// The error of a run: less with a higher rung; the best points are 5, 2, 7, 0, in this order.
double error_of(std::size_t run) {
  constexpr std::array<double, kPoints> errors = {40, 90, 20, 80, 70, 10, 60, 30};
  return errors[run / kSeeds % kPoints] + static_cast<double>(run % kSeeds) - 1.5 * static_cast<double>(run / 16);
}

/// Which points have a run of a rung that is done.
std::vector<std::size_t> computed_points(const MadeSweep& sweep, std::size_t rung) {
  std::vector<std::size_t> points;
  for (std::size_t point = 0; point < kPoints; ++point) {
    for (std::size_t seed = 0; seed < kSeeds; ++seed) {
      const bool is_done = sweep_run_state(sweep.paths(), sweep.id(run_at(rung, point, seed))) == SweepRunState::kDone;
      if (is_done && (points.empty() || points.back() != point)) points.push_back(point);
    }
  }
  return points;
}

/// The sweep, computed by a script in place of hsi4d.
struct HalvingSweep {
  MadeSweep made{make_search};
  SweepPlan plan = made.plan();
  SweepLaunch launch;
  std::string told;

  HalvingSweep() {
    launch.program = "./program.sh";
    launch.threads = 3;
    launch.tell = [this](const std::string& line) { told += line + "\n"; };
    act("");
    for (std::size_t i = 0; i < plan.runs.size(); ++i) {
      made.finish(i, error_of(i));
      const RunPaths run{made.paths().run(made.id(i))};
      made.here().write(run.report(), "");
      const fs::path place = fs::path("ready") / std::to_string(i) / "made" / "runs";
      fs::create_directories(place);
      fs::rename(run.folder, place / made.id(i));
    }
  }

  /// What the script does before it has the results of run $3.
  void act(const std::string& commands, const std::string& seconds = "1") const {
    made.here().write("program.sh", "#!/bin/sh\necho $3 >> order\n" + commands +
                                        "\ncp -r ready/$3/. .\necho '{\"event\": \"done\", \"seconds\": " + seconds +
                                        "}' >> made/attempts/$(printf %016d $3).jsonl\n");
    fs::permissions("program.sh", fs::perms::owner_all);
  }

  SweepOutcome run() { return run_sweep_locally(made.paths(), plan, launch); }
};

using Points = std::vector<std::size_t>;

}  // namespace

TEST_CASE("the best points of a rung are taken, those without a score last") {
  CHECK(best_points({3.0, 1.0, 2.0, 4.0}, -1, 2) == Points{1, 2});
  CHECK(best_points({3.0, 1.0, 2.0, 4.0}, 1, 2) == Points{0, 3});
  CHECK(best_points({3.0, 1.0, 1.0, 1.0}, -1, 2) == Points{1, 2});
  CHECK(best_points({std::nullopt, 1.0, std::nullopt, 9.0}, -1, 3) == Points{0, 1, 3});
  CHECK(best_points({}, -1, 3).empty());
}

TEST_CASE("a launcher computes of each rung the better half, rung after rung") {
  HalvingSweep sweep;
  CHECK(left_out_by_halving(sweep.plan) == kSeeds * (4 + 6));
  const SweepOutcome outcome = sweep.run();
  CHECK(outcome.failures.empty());
  CHECK(outcome.computed == kSeeds * (8 + 4 + 2));
  CHECK(outcome.left_out == kSeeds * (4 + 6));
  CHECK(computed_points(sweep.made, 0).size() == 8);
  CHECK(computed_points(sweep.made, 1) == Points{0, 2, 5, 7});
  CHECK(computed_points(sweep.made, 2) == Points{2, 5});
  const std::vector<SweepRunState> states = sweep_run_states(sweep.made.paths(), sweep.plan);
  CHECK(std::count(states.begin(), states.end(), SweepRunState::kLeftOut) == kSeeds * (4 + 6));
  const SweepResults results = sweep.made.read();
  CHECK(results.groups.size() == 8 + 4 + 2);
  CHECK(results.count(SweepRunState::kLeftOut) == kSeeds * (4 + 6));
  const SweepOutcome again = sweep.run();
  CHECK(again.computed == 0);
  CHECK(again.left_out == kSeeds * (4 + 6));
}

TEST_CASE("no run is started before those of the rung below have ended") {
  HalvingSweep sweep;
  sweep.act("echo begin $3 >> log; sleep 0.0$((7 * $3 % 9)); echo end $3 >> log");
  sweep.run();
  std::ifstream log("log");
  std::string word;
  std::size_t running = 0, last_rung = 0;
  for (std::size_t index = 0; log >> word >> index; running += word == "begin" ? 1 : -1) {
    const std::size_t rung = index / (kPoints * kSeeds);
    CHECK(rung >= last_rung);
    if (rung > last_rung) CHECK(running == 0);
    last_rung = rung;
  }
  CHECK(last_rung == 2);
}

TEST_CASE("a search by halving that is stopped anywhere comes to the same when it goes on") {
  RandomSequence random(5);
  for (int round = 0; round < 6; ++round) {
    HalvingSweep sweep;
    std::size_t stops = 0;
    for (bool is_done = false; !is_done;) {
      int looks = 1 + static_cast<int>(random.below(8));
      sweep.launch.stop_requested = [&looks] { return --looks < 0; };
      try {
        sweep.run();
        is_done = true;
      } catch (const Interrupted&) {
        if (++stops > 6) sweep.launch.stop_requested = {};
        if (stops > 6) sweep.run();
        is_done = stops > 6;
      }
    }
    INFO("round " << round << ", " << stops << " stops");
    CHECK(computed_points(sweep.made, 1) == Points{0, 2, 5, 7});
    CHECK(computed_points(sweep.made, 2) == Points{2, 5});
  }
}

TEST_CASE("a point with a run that fails comes last, and may come back when that is computed again") {
  HalvingSweep sweep;
  sweep.act("if [ $3 = " + std::to_string(run_at(0, 5, 1)) + " ]; then exit 2; fi");
  CHECK(sweep.run().failures.size() == 1);
  CHECK(computed_points(sweep.made, 1) == Points{0, 2, 6, 7});
  CHECK(computed_points(sweep.made, 2) == Points{2, 7});
  sweep.act("");
  CHECK(sweep.run().failures.empty());
  CHECK(computed_points(sweep.made, 1) == Points{0, 2, 5, 6, 7});
  CHECK(computed_points(sweep.made, 2) == Points{2, 5, 7});
}

TEST_CASE("points are judged by the median of all their runs, and are not settled before") {
  MadeSweep sweep(make_search);
  const auto may_end = [&sweep](std::size_t run) {
    return sweep_run_state(sweep.paths(), sweep.id(run)) != SweepRunState::kDone;
  };
  const auto turn = [&](std::size_t run) {
    return SweepTurns(sweep.plan(), done_metrics(sweep.paths(), sweep.plan())).turn(run, may_end);
  };
  for (std::size_t i = 0; i < kPoints * kSeeds - 1; ++i) {
    sweep.finish(i, i % kSeeds == 0 ? 10 : error_of(i));
    CHECK(turn(run_at(0, 3, 0)) == SweepTurn::kNow);
    CHECK(turn(run_at(1, 3, 0)) == SweepTurn::kLater);
    CHECK(turn(run_at(2, 3, 0)) == SweepTurn::kLater);
  }
  sweep.finish(kPoints * kSeeds - 1, 30);
  for (std::size_t point = 0; point < kPoints; ++point) {
    const bool is_good = point == 0 || point == 2 || point == 5 || point == 7;
    CHECK(turn(run_at(1, point, 0)) == (is_good ? SweepTurn::kNow : SweepTurn::kNever));
    CHECK(turn(run_at(2, point, 1)) == SweepTurn::kLater);
  }
}

TEST_CASE("points compete with those of the same ablation and grid alone") {
  MadeSweep sweep([](SweepPlan& plan) {
    make_search(plan);
    for (std::size_t i = 0; i < plan.runs.size(); ++i) plan.runs[i].ablation = i / kSeeds % kPoints < 4 ? "a" : "b";
  });
  for (std::size_t i = 0; i < kPoints * kSeeds; ++i) sweep.finish(i, error_of(i));
  const std::vector<SweepRunState> states = sweep_run_states(sweep.paths(), sweep.plan());
  for (std::size_t point = 0; point < kPoints; ++point) {
    const bool is_good = point == 0 || point == 2 || point == 5 || point == 7;  // two of the first four, two others
    CHECK((states[run_at(1, point, 0)] == SweepRunState::kLeftOut) == !is_good);
  }
}

TEST_CASE("once its hours are over a sweep starts no other run, and goes on with more") {
  HalvingSweep sweep;
  sweep.launch.threads = 1;
  const auto note = [&](std::size_t run, double seconds) {
    SweepClaim(sweep.made.paths(), sweep.made.id(run), {}).note("done", "", seconds);
  };
  sweep.plan.hours = 1;
  sweep.act("", "1000");
  const SweepOutcome outcome = sweep.run();
  CHECK(outcome.computed == 4);
  CHECK(outcome.over_budget == 44);
  CHECK_THAT(sweep.told, Contains("the sweep's 1 h are spent: 44 runs are not started"));
  CHECK(spent_hours(sweep.made.paths(), sweep.plan) == Approx(4000.0 / 3600));
  CHECK(sweep.run().computed == 0);
  sweep.plan.hours = 1.3;
  CHECK(sweep.run().computed == 1);
  note(5, 5000);
  CHECK(is_over_budget(sweep.made.paths(), sweep.plan));
  sweep.plan.hours = 0;
  CHECK(sweep.run().computed == kSeeds * (8 + 4 + 2) - 5);
  sweep.plan.hours = 1;
  const SweepOutcome end = sweep.run();
  CHECK(end.over_budget == 0);  // what halving leaves out was never to be computed
  CHECK(end.left_out == kSeeds * (4 + 6));
  sweep.plan.hours = 0;
  CHECK_FALSE(is_over_budget(sweep.made.paths(), sweep.plan));
}

}  // namespace halving_test
