#include "pipelines/sweep_results.h"

#include <catch2/catch.hpp>

#include "pipelines/sweep_report.h"
#include "pipelines/sweep_tables.h"
#include "tests/support/temporary_folder.h"

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;

namespace {

/// A sweep whose runs have made-up results: ablations plain and other, clips a and b, seeds 0 to 2.
class MadeSweep {
 public:
  MadeSweep() {
    plan_.name = "made";
    plan_.compare = {{"ablation", "plain"}};
    for (const char* ablation : {"plain", "other"}) {
      for (const char* clip : {"a", "b"}) {
        for (const char* seed : {"0", "1", "2"}) {
          SweepRun run;
          run.id =
              std::string(15 - std::to_string(plan_.runs.size()).size(), '0') + "f" + std::to_string(plan_.runs.size());
          run.ablation = ablation;
          run.clip = clip;
          run.seed = seed;
          run.config = "{}";
          plan_.runs.push_back(run);
        }
      }
    }
    write_sweep_plan(paths_, plan_, false);
  }

  /// A run that is done with this error.
  void finish(std::size_t index, double mpjpe) {
    const RunPaths run{paths_.run(plan_.runs[index].id)};
    here_.write(run.status(), R"({"state": "done"})");
    here_.write(run.summary(), R"({"name": "x", "frames": 4, "seconds": 2, "truth": true, "metrics": [
      {"stage": "interaction", "seconds": 1, "iterations": 5, "mpjpe_mm": 99},
      {"stage": "refinement", "seconds": 1, "iterations": 5, "mpjpe_mm": )" +
                                   std::to_string(mpjpe) + R"(}],
      "baselines": {}, "per_frame": [], "baselines_per_frame": {}})");
  }

  void finish_all() {
    // plain: seeds 0, 1, 2 of clip a, then of b; other: 1, 2, 6 more in clip a, 3 more in b.
    const double errors[] = {10, 20, 30, 40, 50, 60, 11, 22, 36, 43, 53, 63};
    for (std::size_t i = 0; i < 12; ++i) finish(i, errors[i]);
  }

  SweepResults read() const { return read_sweep_results(paths_); }
  const SweepPaths& paths() const { return paths_; }
  const SweepPlan& plan() const { return plan_; }

 private:
  TemporaryFolder here_;
  SweepPaths paths_{"made"};
  SweepPlan plan_;
};

const MetricFacts& mpjpe() { return *find_metric_facts("mpjpe_mm"); }

}  // namespace

TEST_CASE("means are over seeds, of each seed over its clips") {
  MadeSweep sweep;
  sweep.finish_all();
  const SweepResults results = sweep.read();
  REQUIRE(results.groups.size() == 2);
  CHECK(results.groups[0].label == "plain");
  CHECK(results.groups[0].is_reference);
  CHECK_FALSE(results.groups[1].is_reference);
  const SampleStatistics plain = group_statistics(results, results.groups[0], mpjpe());
  CHECK(plain.count == 3);  // 25, 35, 45
  CHECK(plain.mean == Approx(35));
  CHECK(plain.deviation == Approx(10));
  const SampleStatistics other = group_statistics(results, results.groups[1], mpjpe(), &results.clips[0]);
  CHECK(other.mean == Approx(23));  // 11, 22, 36
  CHECK(other.deviation == Approx(std::sqrt((144 + 1 + 169) / 2.0)));
  CHECK(results.metrics.size() == 2);  // and the time
}

TEST_CASE("differences are between runs of the same clip and seed") {
  MadeSweep sweep;
  sweep.finish_all();
  const SweepResults results = sweep.read();
  CHECK(partner_of(results.plan, 6) == 0);
  CHECK(partner_of(results.plan, 11) == 5);
  CHECK_FALSE(partner_of(results.plan, 0));
  const auto paired = paired_difference(results, results.groups[1], mpjpe());
  REQUIRE(paired);
  CHECK(paired->differences == std::vector<double>{1, 2, 6, 3, 3, 3});
  CHECK(paired->statistics.mean == Approx(3));
  REQUIRE(paired->interval);
  CHECK(paired->interval->low > 1.6);
  CHECK(paired->interval->low < 2.2);
  CHECK(paired->interval->high > 3.8);
  CHECK(paired->interval->high < 4.7);
  const SweepTable table = difference_table(results);
  REQUIRE(table.rows.size() == 1);
  CHECK(table.rows[0].cells[0].mark == SweepCell::Mark::kWorse);
  CHECK_THAT(table.rows[0].cells[0].text, Contains("+3.0 [+"));
}

TEST_CASE("a sweep that is not complete tells what is there") {
  MadeSweep sweep;
  for (const std::size_t i : {0, 1, 3, 6}) sweep.finish(i, 10.0 + static_cast<double>(i));
  SweepClaim(sweep.paths(), sweep.plan().runs[7].id, {}).note("failed", "no scene", 1);
  const SweepResults results = sweep.read();
  CHECK(progress_text(results) == "12 runs: 4 done, 1 failed, 7 new");
  CHECK(group_statistics(results, results.groups[0], mpjpe()).count == 1);  // of seed 0 alone both clips are done
  CHECK(group_statistics(results, results.groups[0], mpjpe()).mean == Approx(11.5));
  CHECK(group_statistics(results, results.groups[1], mpjpe()).count == 0);
  CHECK(paired_difference(results, results.groups[1], mpjpe())->differences == std::vector<double>{6});
  const std::string text = sweep_markdown(results);
  CHECK_THAT(text, Contains("- run 7, a, other, seed 1: failed, no scene\n"));
  CHECK_THAT(sweep_csv(results), Contains("\n6,00000000000000f6,,a,other,0,done,0,,,,,,16,2\n"));
  CHECK_THAT(sweep_page(results), Contains("<p class=\"message\">no scene</p>"));
}

TEST_CASE("a run with a damaged summary is not done") {
  MadeSweep sweep;
  sweep.finish(0, 10);
  const std::string id = sweep.plan().runs[0].id;
  CHECK(sweep_run_state(sweep.paths(), id) == SweepRunState::kDone);
  std::ofstream(RunPaths{sweep.paths().run(id)}.summary()) << "{\"name\": \"x\", \"frames\": 4, \"met";
  CHECK(sweep_run_state(sweep.paths(), id) == SweepRunState::kStarted);
}

TEST_CASE("attempts that were cut short are passed over, and the next ones kept") {
  MadeSweep sweep;
  const std::string id = sweep.plan().runs[0].id;
  SweepClaim(sweep.paths(), id, {}).note("start");
  std::ofstream(sweep.paths().attempts(id), std::ios::app) << "{\"event\": \"do";
  SweepClaim(sweep.paths(), id, {}).note("start", "again");
  const std::vector<SweepAttempt> attempts = read_attempts(sweep.paths(), id);
  REQUIRE(attempts.size() == 2);
  CHECK(attempts[1].message == "again");
  CHECK(attempts[1].program.hash == this_program().hash);
  CHECK_FALSE(is_claimed(sweep.paths(), id));
  const SweepClaim claim(sweep.paths(), id, {});
  CHECK(is_claimed(sweep.paths(), id));
  CHECK_THROWS_WITH(SweepClaim(sweep.paths(), id, [] { return true; }),
                    "interrupted while another process computed run " + id);
}

TEST_CASE("runs of an axis are compared with the same values of the others") {
  SweepPlan plan;
  plan.compare = {{"ablation", "plain"}};
  for (const char* ablation : {"plain", "other"}) {
    for (const char* blur : {"0.1", "0.2"}) {
      SweepRun run;
      run.ablation = ablation;
      run.values = {{"render.blur", blur}};
      plan.runs.push_back(run);
    }
  }
  CHECK(partner_of(plan, 2) == 0);
  CHECK(partner_of(plan, 3) == 1);
  CHECK_FALSE(partner_of(plan, 1));
  plan.compare = {{"render.blur", "0.2"}};
  CHECK(partner_of(plan, 0) == 1);
  CHECK(partner_of(plan, 2) == 3);
  CHECK_FALSE(partner_of(plan, 3));
}
