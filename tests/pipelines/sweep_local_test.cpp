#include "pipelines/sweep_local.h"

#include <catch2/catch.hpp>

#include "tests/pipelines/tiny_sweep.h"
#include "tests/support/program.h"

using namespace hsi4d;
using namespace hsi4d::test;

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

TEST_CASE("runs that do not fit into the memory beside each other are computed one after the other", "[release]") {
  const TemporaryFolder here;
  write_tiny_base(2);
  write_sweep({{"seeds", 3}, {"memory_mb", 400}});
  const ProgramResult sweep = run_hsi4d({"sweep", "sweep.json", "--out", "out", "--threads", "3", "--memory", "500"});
  INFO(sweep.err);
  REQUIRE(sweep.status == 0);
  std::vector<std::pair<std::string, std::string>> times;  // of start and end
  for (const std::string& id : ids_of("out")) {
    const std::vector<SweepAttempt> attempts = read_attempts({"out"}, id);
    REQUIRE(attempts.size() == 2);
    times.emplace_back(attempts[0].time, attempts[1].time);
  }
  std::sort(times.begin(), times.end());
  CHECK(times[0].second <= times[1].first);
  CHECK(times[1].second <= times[2].first);
}
