#include "pipelines/sweep/local.h"

#include <filesystem>

#include <catch2/catch.hpp>

#include "tests/support/made_sweep.h"

namespace local_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
using Catch::Matchers::EndsWith;
using Catch::Matchers::StartsWith;
namespace fs = std::filesystem;

namespace {

/// A sweep that a script in place of hsi4d computes: it is started as `hsi4d run-one PLAN INDEX --out DIR ...`.
struct StandIn {
  MadeSweep made;
  SweepPlan plan;
  SweepLaunch launch;
  std::string told;

  explicit StandIn(std::size_t runs) : made([runs](SweepPlan& whole) { whole.runs.resize(runs); }), plan(made.plan()) {
    launch.program = "./program.sh";
    launch.threads = 2;
    launch.tell = [this](const std::string& line) { told += line + "\n"; };
    act("if [ -e ready/$3 ]; then cp -r ready/$3/. .; fi");
  }

  const SweepPaths& paths() const { return made.paths(); }
  const std::string& id(std::size_t index) const { return made.id(index); }

  /// What the script does.
  void act(const std::string& commands) const {
    made.here().write("program.sh", "#!/bin/sh\n" + commands + "\n");
    fs::permissions("program.sh", fs::perms::owner_all);
  }

  /// Puts the results of a run where the script finds them: all that is in ready/INDEX belongs here.
  void prepare(std::size_t index) {
    made.finish(index, 10);
    const RunPaths run{paths().run(id(index))};
    made.here().write(run.report(), "");
    const fs::path place = fs::path("ready") / std::to_string(index) / "made" / "runs";
    fs::create_directories(place);
    fs::rename(run.folder, place / id(index));
  }

  SweepOutcome run() { return run_sweep_locally(paths(), plan, launch); }
};

}  // namespace

TEST_CASE("threads are shared out among the jobs") {
  SweepPlan plan;
  SweepLaunch launch;
  launch.threads = 8;
  CHECK(sweep_jobs(plan, launch) == 8);
  CHECK(sweep_threads(plan, launch) == 1);
  launch.jobs = 3;
  CHECK(sweep_jobs(plan, launch) == 3);
  CHECK(sweep_threads(plan, launch) == 2);
  launch.jobs = 20;
  CHECK(sweep_threads(plan, launch) == 1);
  plan.threads = 4;
  CHECK(sweep_threads(plan, launch) == 4);
  launch.jobs = 0;
  CHECK(sweep_jobs(plan, launch) == 2);
  launch.threads = 2;
  CHECK(sweep_jobs(plan, launch) == 1);
}

TEST_CASE("runs that do not fit into the memory beside each other are computed one after the other") {
  StandIn sweep(4);
  // Whoever finds the folder there was started beside another one.
  sweep.act("mkdir busy || echo $3 >> overlaps; sleep 0.1; rmdir busy; exit 2");
  sweep.launch.threads = 3;
  sweep.plan.memory_mb = 400;
  sweep.launch.memory_mb = 500;
  CHECK(sweep.run().failures.size() == 4);
  CHECK_FALSE(fs::exists("overlaps"));
  CHECK(sweep.told.find("one at a time") == std::string::npos);
  sweep.launch.memory_mb = 300;
  sweep.run();
  CHECK_FALSE(fs::exists("overlaps"));
  CHECK_THAT(sweep.told, Contains("a run takes up to 400 MB, and there are 300 MB for all together: one at a time"));
}

TEST_CASE("a run that a signal ended gets the line that it could not write") {
  StandIn sweep(2);
  sweep.act("echo in despair; kill -9 $$");
  const SweepOutcome outcome = sweep.run();
  REQUIRE(outcome.failures.size() == 2);
  CHECK_THAT(outcome.failures[0].message,
             StartsWith("was ended by signal 9, most often for want of memory") && EndsWith(":\nin despair"));
  const std::vector<SweepAttempt> attempts = read_attempts(sweep.paths(), sweep.id(0));
  REQUIRE(attempts.size() == 1);
  CHECK(attempts[0].event == "failed");
  CHECK(attempts[0].message == outcome.failures[0].message);
  CHECK(sweep_run_state(sweep.paths(), sweep.id(0)) == SweepRunState::kFailed);
}

TEST_CASE("a run that is killed is computed again with twice the memory, so often as the sweep asks") {
  StandIn sweep(3);
  for (std::size_t i = 0; i < 3; ++i) sweep.prepare(i);
  // Run 1 is killed twice.
  sweep.act(
      "[ $3 = 1 ] && echo x >> tries; "
      "if [ $3 = 1 ] && [ $(wc -l < tries) -le 2 ]; then kill -9 $$; fi; cp -r ready/$3/. .; "
      "echo '{\"event\": \"done\"}' >> made/attempts/00000000000000f$3.jsonl");
  sweep.plan.memory_mb = 400;
  sweep.plan.memory_retries = 2;
  sweep.launch.memory_mb = 900;
  const SweepOutcome outcome = sweep.run();
  INFO(sweep.told);
  CHECK(outcome.failures.empty());
  CHECK(outcome.computed == 3);
  CHECK_THAT(sweep.told, Contains("it is computed again, with 800 MB") &&
                             Contains("it is computed again, with 1600 MB") &&
                             Contains("a run takes up to 1600 MB, and there are 900 MB for all together"));
}

TEST_CASE("a run that is killed more often than it is computed again has failed") {
  StandIn sweep(1);
  sweep.act("kill -9 $$");
  sweep.plan.memory_retries = 1;
  CHECK(sweep.run().failures.size() == 1);
  CHECK(read_attempts(sweep.paths(), sweep.id(0)).size() == 2);
}

TEST_CASE("what a run has noted of its failure is told and not noted again") {
  StandIn sweep(1);
  SweepClaim(sweep.paths(), sweep.id(0), {}).note("failed", "of long ago");
  const std::string line = R"({\"event\": \"failed\", \"message\": \"no scene\"})";
  sweep.act("echo \"" + line + "\" >> made/attempts/" + sweep.id(0) + ".jsonl; exit 3");
  SweepOutcome outcome = sweep.run();
  REQUIRE(outcome.failures.size() == 1);
  CHECK(outcome.failures[0].message == "no scene");
  CHECK(outcome.failures[0].is_our_bug);
  CHECK(read_attempts(sweep.paths(), sweep.id(0)).size() == 2);
  sweep.act("echo it is dark; exit 2");  // before it could note anything
  outcome = sweep.run();
  CHECK(outcome.failures[0].message == "ended with status 2:\nit is dark");
  CHECK(read_attempts(sweep.paths(), sweep.id(0)).back().message == "ended with status 2:\nit is dark");
}

TEST_CASE("a run that ends well without results has failed") {
  StandIn sweep(2);
  sweep.prepare(1);
  const SweepOutcome outcome = sweep.run();
  CHECK(outcome.computed == 1);
  REQUIRE(outcome.failures.size() == 1);
  CHECK(outcome.failures[0].message == "ended as if it were done, and its results are not whole; it printed nothing");
}

TEST_CASE("a run that cannot be started does not end the others") {
  StandIn sweep(3);
  fs::create_directories(sweep.paths().printed(sweep.id(0)));  // where its output should go
  sweep.prepare(1);
  sweep.prepare(2);
  const SweepOutcome outcome = sweep.run();
  CHECK(outcome.computed == 2);
  REQUIRE(outcome.failures.size() == 1);
  CHECK_THAT(outcome.failures[0].message, StartsWith(sweep.paths().printed(sweep.id(0)) + ": cannot be written: "));
}

TEST_CASE("a run that another launcher computes keeps no place from the others") {
  StandIn sweep(3);
  // The first one is found claimed once, the second time it is computed.
  sweep.act("if [ $3 = 0 ] && mkdir once; then exit 75; fi; cp -r ready/$3/. .");
  for (std::size_t i = 0; i < 3; ++i) sweep.prepare(i);
  sweep.launch.jobs = 1;
  const SweepOutcome outcome = sweep.run();
  CHECK(outcome.computed == 3);
  CHECK(outcome.failures.empty());
  CHECK_THAT(sweep.told, StartsWith("1/3 run 1, ") && Contains("\n3/3 run 0, "));
}

TEST_CASE("after a failure what runs is interrupted and counted once") {
  StandIn sweep(4);
  sweep.act(
      "if [ $3 = 0 ]; then while [ ! -e running ]; do sleep 0.01; done; exit 2; fi; "
      "trap 'exit 130' INT; touch running; while true; do sleep 0.01; done");
  sweep.launch.jobs = 2;
  sweep.launch.fail_fast = true;
  const SweepOutcome outcome = sweep.run();
  CHECK(outcome.failures.size() == 1);
  CHECK(outcome.computed == 0);
  CHECK(outcome.not_done == std::vector<std::size_t>{1, 2, 3});
}

}  // namespace local_test
