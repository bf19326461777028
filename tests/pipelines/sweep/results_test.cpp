#include "pipelines/sweep/results.h"

#include <catch2/catch.hpp>

#include "core/file.h"
#include "pipelines/record/folder.h"
#include "pipelines/sweep/report.h"
#include "pipelines/sweep/tables.h"
#include "tests/support/made_sweep.h"

namespace results_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;

namespace {

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
  const SampleStatistics plain = group_statistics(results, results.groups[0], mpjpe()).sample;
  CHECK(plain.count == 3);  // 25, 35, 45
  CHECK(plain.mean == Approx(35));
  CHECK(plain.deviation == Approx(10));
  const SampleStatistics other = group_statistics(results, results.groups[1], mpjpe(), &results.clips[0]).sample;
  CHECK(other.mean == Approx(23));  // 11, 22, 36
  CHECK(other.deviation == Approx(std::sqrt((144 + 1 + 169) / 2.0)));
  CHECK(results.metrics.size() == 2);  // and the time
}

TEST_CASE("the share of quality gates that pass is a metric of a sweep") {
  MadeSweep sweep;
  sweep.finish(0, 10);
  CHECK(find_metric(sweep.read().rows[0].values, "gates_passed") == nullptr);
  sweep.here().write(RunPaths{sweep.paths().run(sweep.id(0))}.summary(), R"({"name": "x", "frames": 4, "seconds": 2,
      "metrics": [{"stage": "s", "seconds": 1, "iterations": 5, "mpjpe_mm": 10}], "quality": {
      "silhouette_iou": {"value": 0.9, "word": "pass", "pass": 0.85, "check": 0.7},
      "foot_sliding_mm": {"value": 12, "word": "check", "pass": 10, "check": 25},
      "a_gate_of_later": {"value": 12, "word": "fail", "pass": 10, "check": 11}}})");
  const SweepResults results = sweep.read();
  const double* const passed = find_metric(results.rows[0].values, "gates_passed");
  REQUIRE(passed != nullptr);
  CHECK(*passed == 0.5);
  CHECK(mean_table(results).head.back().text == "time, s ↓");
  CHECK(mean_table(results).head[mean_table(results).head.size() - 2].text == "quality gates ↑");
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
  const Table table = difference_table(results);
  REQUIRE(table.rows.size() == 1);
  CHECK(table.head[1].text == "pairs");
  CHECK(table.rows[0][1].text == "6");
  CHECK(table.rows[0][2].mark == "worse");
  CHECK_THAT(table.rows[0][2].text, Contains("+3.0 [+"));
}

TEST_CASE("warnings of runs are told with how many runs have them, once a run") {
  MadeSweep sweep;
  sweep.finish_all();
  CHECK(warnings_text(sweep.read()).empty());
  const auto log = [&sweep](std::size_t run, const std::string& text) {
    write_text_file(RunPaths{sweep.paths().run(sweep.plan().runs[run].id)}.log(), text);
  };
  log(0,
      "2026-01-01T00:00:00.000+00:00 info warning of nothing\n2026-01-01T00:00:01.000+00:00 warning one <was> here\n");
  log(3,
      "2026-01-01T00:00:01.000+00:00 warning seldom\n2026-01-01T00:00:01.000+00:00 warning one <was> here\n"
      "2026-01-01T00:00:02.000+00:00 warning one <was> here\n");
  const SweepResults results = sweep.read();
  CHECK(warnings_text(results) == "- 2 of 12 runs: one <was> here\n- 1 of 12 runs: seldom\n");
  CHECK_THAT(sweep_markdown(results), Contains("\n## Warnings\n\n- 2 of 12 runs: one <was> here\n"));
  CHECK_THAT(sweep_page(results), Contains("<h2>Warnings</h2>") && Contains("one &lt;was&gt; here"));
}

TEST_CASE("a sweep that is not complete tells what is there") {
  MadeSweep sweep;
  for (const std::size_t i : {0, 1, 3, 6}) sweep.finish(i, 10.0 + static_cast<double>(i));
  SweepClaim(sweep.paths(), sweep.plan().runs[7].id, {}).note("failed", "no scene", 1);
  const SweepResults results = sweep.read();
  CHECK(progress_text(results) == "12 runs: 4 done, 1 failed, 7 new");
  CHECK(group_statistics(results, results.groups[0], mpjpe()).sample.count ==
        1);  // of seed 0 alone both clips are done
  CHECK(group_statistics(results, results.groups[0], mpjpe()).sample.mean == Approx(11.5));
  CHECK(group_statistics(results, results.groups[1], mpjpe()).sample.count == 0);
  CHECK(paired_difference(results, results.groups[1], mpjpe())->differences == std::vector<double>{6});
  const std::string text = sweep_markdown(results);
  CHECK_THAT(text, Contains("- run 7, a, other, seed 1: failed, no scene\n"));
  CHECK_THAT(sweep_csv(results), Contains("\n6,00000000000000f6,\"a, other, seed 0\",,a,other,0,done,0,0,,,,,,16,2\n"));
  CHECK_THAT(sweep_page(results), Contains("<p class=\"message\">no scene</p>"));
}

TEST_CASE("the best is marked among means of the same runs alone") {
  MadeSweep sweep;
  sweep.finish_all();
  const auto table = [&sweep] { return mean_table(sweep.read()); };
  std::vector<std::string> head;
  for (const Cell& cell : table().head) head.push_back(cell.text);
  CHECK(head == std::vector<std::string>{"", "seeds", "clips", "MPJPE, mm ↓", "time, s ↓"});
  CHECK(table().rows[0][3].mark == "best");
  CHECK(table().rows[0][1].text == "3");
  CHECK(table().rows[0][2].text == "2");
  std::filesystem::remove_all(sweep.paths().run(sweep.id(11)));  // of "other" the worst one is missing now
  CHECK(table().rows[1][1].text == "2");
  for (const auto& row : table().rows) CHECK(row[3].mark.empty());
}

TEST_CASE("of a seed that lacks a clip there is no mean") {
  MadeSweep sweep([](SweepPlan& plan) {
    std::erase_if(plan.runs,
                  [](const SweepRun& run) { return run.clip == "b" && run.seed == "2" && run.ablation == "plain"; });
  });
  for (std::size_t i = 0; i < sweep.plan().runs.size(); ++i) sweep.finish(i, 10);
  const SweepResults results = sweep.read();
  CHECK(group_statistics(results, results.groups[0], mpjpe()).sample.count == 2);
  CHECK(group_statistics(results, results.groups[0], mpjpe()).clip_seeds.size() == 4);
  CHECK(group_statistics(results, results.groups[1], mpjpe()).sample.count == 3);
}

TEST_CASE("a run that two combinations come to counts once") {
  MadeSweep sweep([](SweepPlan& plan) {
    const std::vector<SweepRun> runs = plan.runs;
    plan.runs.insert(plan.runs.end(), runs.begin(), runs.end());
  });
  sweep.finish_all();
  const SweepResults results = sweep.read();
  CHECK(results.rows.size() == 24);
  CHECK(paired_difference(results, results.groups[1], mpjpe())->differences.size() == 6);
  CHECK(group_statistics(results, results.groups[0], mpjpe()).sample.count == 3);
}

TEST_CASE("labels with bars stay in their cells") {
  MadeSweep sweep([](SweepPlan& plan) { plan.runs[0].values = {{"data.frames", "\"a|b\""}}; });
  sweep.finish_all();
  CHECK_THAT(sweep_markdown(sweep.read()), Contains("| plain, frames a\\|b"));
}

TEST_CASE("a run whose process is gone without a word is told") {
  MadeSweep sweep;
  { SweepClaim(sweep.paths(), sweep.id(0), {}).note("start"); }
  const SweepClaim computing(sweep.paths(), sweep.id(1), {});
  SweepClaim other = *SweepClaim::try_claim(sweep.paths(), sweep.id(2));
  other.note("start");
  const SweepResults results = sweep.read();
  CHECK(results.rows[0].last->message ==
        "its process ended without a word: it was killed, for want of memory perhaps, or its machine is gone");
  CHECK(results.rows[2].last->message.empty());
  CHECK(results.rows[0].programs == 1);
  CHECK_FALSE(SweepClaim::try_claim(sweep.paths(), sweep.id(1)));
}

TEST_CASE("how a run stands is what happened last") {
  MadeSweep sweep;
  const std::string id = sweep.id(0);
  const auto note = [&](const char* event) { SweepClaim(sweep.paths(), id, {}).note(event); };
  const auto set_status = [&](const char* state) {
    sweep.here().write(RunPaths{sweep.paths().run(id)}.status(), R"({"state": ")" + std::string(state) + "\"}");
  };
  CHECK(sweep_run_state(sweep.paths(), id) == SweepRunState::kNew);
  set_status("failed");
  CHECK(sweep_run_state(sweep.paths(), id) == SweepRunState::kFailed);
  note("start");
  CHECK(sweep_run_state(sweep.paths(), id) == SweepRunState::kStarted);
  set_status("running");
  note("failed");  // by its launcher: a signal ended it
  CHECK(sweep_run_state(sweep.paths(), id) == SweepRunState::kFailed);
  sweep.finish(0, 10);
  CHECK(sweep_run_state(sweep.paths(), id) == SweepRunState::kDone);
  sweep.here().write(RunPaths{sweep.paths().run(id)}.report(), "");
  CHECK_FALSE(is_sweep_run_whole(sweep.paths(), id));  // killed before its end was noted
  note("done");
  CHECK(is_sweep_run_whole(sweep.paths(), id));
}

TEST_CASE("what killed writers have left in a sweep's folder goes when its lock is taken") {
  MadeSweep sweep;
  for (const char* name : {"made/sweep.json.1-0.tmp", "made/configs/a.json.1-1.tmp", "made/plans/b.json.1-2.tmp"})
    sweep.here().write(name, "{");
  sweep.here().write("made/runs/x/summary.json.1-3.tmp", "{");  // of a run: for whoever computes it
  write_sweep_results(sweep.paths());
  CHECK_FALSE(std::filesystem::exists("made/sweep.json.1-0.tmp"));
  CHECK_FALSE(std::filesystem::exists("made/configs/a.json.1-1.tmp"));
  CHECK_FALSE(std::filesystem::exists("made/plans/b.json.1-2.tmp"));
  CHECK(std::filesystem::exists("made/runs/x/summary.json.1-3.tmp"));
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

}  // namespace results_test
