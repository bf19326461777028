// What is submitted to Slurm, told by programs that stand in for its own; tests/tools/slurm_sweep_test.py has a
// cluster.
#include "pipelines/sweep/slurm.h"

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <sstream>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/process.h"
#include "optim/checkpoint.h"
#include "pipelines/cli/interrupt.h"
#include "tests/support/made_sweep.h"

namespace slurm_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
namespace fs = std::filesystem;

namespace {

/// A sweep of four runs, and sbatch, squeue and scontrol as scripts: what sbatch is asked for is in sbatch.txt, what
/// squeue tells in queue.txt, of a job that jobs.txt names in job.txt.
struct StandInCluster {
  MadeSweep made;
  std::string path = std::getenv("PATH");

  /// @param change  what is other than that
  explicit StandInCluster(const std::function<void(SweepPlan&)>& change = {})
      : made([&change](SweepPlan& plan) {
          plan.runs.resize(4);
          if (change) change(plan);
        }) {
    script("sbatch", "echo \"$*\" >> sbatch.txt; echo $((100 + $(wc -l < sbatch.txt)))");
    script("squeue",
           "case \"$*\" in *--me*) cat queue.txt;; *) [ -e job.txt ] && cat job.txt || "
           "{ cat trouble.txt >&2; exit 1; };; esac");
    script("scontrol", "echo 'MaxArraySize = 1001'");
    made.here().write("queue.txt", "");
    made.here().write("trouble.txt", "slurm_load_jobs error: Invalid job id specified\n");
    ::setenv("PATH", ((made.here().path() / "bin").string() + ":" + path).c_str(), 1);
  }
  ~StandInCluster() { ::setenv("PATH", path.c_str(), 1); }
  StandInCluster(const StandInCluster&) = delete;
  StandInCluster& operator=(const StandInCluster&) = delete;

  void script(const std::string& name, const std::string& commands) const {
    made.here().write("bin/" + name, "#!/bin/sh\n" + commands + "\n");
    fs::permissions("bin/" + name, fs::perms::owner_all);
  }

  SlurmJobs submit() const { return submit_sweep(made.paths(), made.plan(), "/opt/hsi4d", 0, 2); }

  /// The comment of jobs of this sweep.
  std::string comment(const std::string& what) const {
    return "hsi4d:" + text_hash((fs::absolute("made") / "slurm").lexically_normal().string()) + ":" + what;
  }
  std::string plan_name() const { return fs::path(made.paths().frozen_plan(made.plan())).filename().string(); }

  std::vector<std::string> asked() const {
    std::vector<std::string> lines;
    std::istringstream text(file_text("sbatch.txt"));
    for (std::string line; std::getline(text, line);) lines.push_back(line);
    return lines;
  }
};

/// A variable of the environment while it lives.
struct Environment {
  std::string name;

  Environment(const std::string& variable, const std::string& value) : name(variable) {
    ::setenv(name.c_str(), value.c_str(), 1);
  }
  ~Environment() { ::unsetenv(name.c_str()); }
  Environment(const Environment&) = delete;
  Environment& operator=(const Environment&) = delete;
};

/// While it lives, SIGUSR1 is blocked where nothing unblocks it, and does what it did before afterwards.
struct Held {
  sigset_t before;

  Held() {
    sigset_t warning;
    sigemptyset(&warning);
    sigaddset(&warning, SIGUSR1);
    pthread_sigmask(SIG_BLOCK, &warning, &before);
  }
  ~Held() { pthread_sigmask(SIG_SETMASK, &before, nullptr); }
  Held(const Held&) = delete;
  Held& operator=(const Held&) = delete;
};

}  // namespace

TEST_CASE("a sweep is submitted as an array and a job for its results") {
  const StandInCluster cluster;
  const SlurmJobs jobs = cluster.submit();
  CHECK(jobs.arrays == std::vector<std::string>{"101"});
  CHECK(jobs.results == "102");
  REQUIRE(cluster.asked().size() == 2);
  CHECK_THAT(cluster.asked()[0],
             Contains("--array=0-3 ") && Contains("--comment=" + cluster.comment(cluster.plan_name())));
  CHECK_THAT(cluster.asked()[1], Contains("--dependency=afterany:101 ") && Contains(cluster.comment("results")));
  CHECK(file_text("made/slurm/jobs.txt") == "101 " + cluster.plan_name() + "\n");
  CHECK_THAT(file_text("made/slurm/run.sh"), Contains("exec $hold '/opt/hsi4d' run-one '") && Contains(" --requeue\n"));
}

TEST_CASE("a warning that comes before the program can note it waits for it") {
  const StandInCluster cluster;
  // A program that gets the warning first of all, and tells which signals wait for it; a child would change that.
  cluster.script("hsi4d", "kill -USR1 $$; while read -r line; do echo \"$line\"; done < /proc/$$/status > waiting.txt");
  submit_sweep(cluster.made.paths(), cluster.made.plan(), fs::absolute("bin/hsi4d").string(), 0, 1);
  run_process({"sh", "made/slurm/run.sh"});
  CHECK_THAT(file_text("waiting.txt"), Contains("ShdPnd:\t0000000000000200"));  // the bit of signal 10

  const Held held;
  ::raise(SIGUSR1);
  const cli::TimeLimitWatch watch;
  CHECK(cli::TimeLimitWatch::requested());
}

TEST_CASE("where env cannot block the warning, it does not kill the program at least") {
  const StandInCluster cluster;
  cluster.script("hsi4d", "kill -USR1 $$; echo alive > alive.txt");
  cluster.script("env", "exit 125");
  submit_sweep(cluster.made.paths(), cluster.made.plan(), fs::absolute("bin/hsi4d").string(), 0, 1);
  run_process({"sh", "made/slurm/run.sh"});
  CHECK(file_text("alive.txt") == "alive\n");
}

TEST_CASE("a task of an array puts itself alone into the queue again") {
  const StandInCluster cluster;
  cluster.script("scontrol", "echo \"$*\" >> scontrol.txt");
  const Environment job("SLURM_JOB_ID", "7");
  requeue_this_job();
  const Environment array("SLURM_ARRAY_JOB_ID", "7"), task("SLURM_ARRAY_TASK_ID", "2");  // the last: the array's number
  requeue_this_job();
  CHECK(file_text("scontrol.txt") == "requeue 7\nrequeue 7_2\n");
}

TEST_CASE("more runs than Slurm takes in an array are several, whose tasks count from their first run") {
  const StandInCluster cluster;
  cluster.script("scontrol", "echo 'MaxArraySize = 3'");
  const SlurmJobs jobs = cluster.submit();
  CHECK(jobs.arrays == std::vector<std::string>{"101", "102"});
  CHECK(jobs.results == "103");
  const std::string later = cluster.plan_name() + "+3";
  CHECK_THAT(cluster.asked()[0], Contains("--array=0-2 ") && Contains(cluster.comment(cluster.plan_name()) + " "));
  CHECK_THAT(cluster.asked()[1],
             Contains("--array=0 ") && Contains(cluster.comment(later) + " ") && !Contains("--dependency"));
  CHECK_THAT(cluster.asked()[2], Contains("--dependency=afterany:101:102 "));
  CHECK(file_text("made/slurm/jobs.txt") == "101 " + cluster.plan_name() + "\n102 " + later + "\n");
  CHECK_THAT(file_text("made/slurm/run.sh"), Contains(" \"$SLURM_ARRAY_TASK_ID\" --out "));
  CHECK_THAT(file_text("made/slurm/run_from_3.sh"), Contains(" \"$((SLURM_ARRAY_TASK_ID + 3))\" --out "));

  // What is in the queue is told by the tasks of its array, by comments and by jobs.txt.
  cluster.made.here().write("queue.txt", "101 1 " + cluster.comment(cluster.plan_name()) + "\n102 0 its_owner's\n");
  cluster.made.here().write("job.txt", "0\n");
  const SlurmJobs rest = cluster.submit();
  CHECK(rest.queued == 2);
  CHECK(rest.runs == std::vector<std::size_t>{0, 2});
}

TEST_CASE("arrays of which only so many runs may be computed at once wait for each other") {
  const StandInCluster cluster;
  cluster.script("scontrol", "echo 'MaxArraySize = 3'");
  submit_sweep(cluster.made.paths(), cluster.made.plan(), "/opt/hsi4d", 2, 1);
  CHECK_THAT(cluster.asked()[0], Contains("--array=0-2%2 ") && !Contains("--dependency"));
  CHECK_THAT(cluster.asked()[1], Contains("--array=0%2 ") && Contains("--dependency=afterany:101 "));
}

TEST_CASE("what a killed launcher has submitted is not submitted again") {
  const StandInCluster cluster;
  // Killed right after sbatch: nothing is in jobs.txt, and the job for the results is missing.
  const std::string comment = cluster.comment(cluster.plan_name());
  cluster.made.here().write("queue.txt", "7 0 " + comment + "\n7 1 " + comment + "\n7 2 " + comment + "\n7 3 " +
                                             comment + "\n9 N/A of_another_sweep\n8 N/A\n");
  const SlurmJobs jobs = cluster.submit();
  CHECK(jobs.queued == 4);
  CHECK(jobs.arrays.empty());
  CHECK(jobs.results == "101");
  CHECK_THAT(cluster.asked().at(0), Contains("--dependency=afterany:7 "));
  cluster.made.here().write("queue.txt", file_text("queue.txt") + "10 N/A " + cluster.comment("results") + "\n");
  const SlurmJobs none = cluster.submit();
  CHECK(none.queued == 4);
  CHECK(none.results.empty());
  CHECK(cluster.asked().size() == 1);
}

TEST_CASE("runs that an array has left are submitted, and the results wait for both") {
  const StandInCluster cluster;
  cluster.made.here().write("made/slurm/jobs.txt",
                            "5 " + cluster.plan_name() + "\n");  // its comment was the user's own
  cluster.made.here().write("job.txt", "1\n2\n");
  const SlurmJobs jobs = cluster.submit();
  CHECK(jobs.queued == 2);
  CHECK(jobs.runs == std::vector<std::size_t>{0, 3});
  CHECK_THAT(cluster.asked().at(1), Contains("--dependency=afterany:101:5 "));
  CHECK(file_text("made/slurm/jobs.txt") == "5 " + cluster.plan_name() + "\n101 " + cluster.plan_name() + "\n");
}

TEST_CASE("a job that Slurm does not know has ended, and any other trouble is told") {
  const StandInCluster cluster;
  cluster.made.here().write("made/slurm/jobs.txt", "5 " + cluster.plan_name() + "\n");
  CHECK(cluster.submit().runs.size() == 4);
  cluster.made.here().write("trouble.txt", "Unable to contact slurm controller\n");
  CHECK_THROWS_WITH(cluster.submit(), "squeue: ended with status 1:\nUnable to contact slurm controller");
}

TEST_CASE("the rungs of a search are arrays, of which each waits for those below") {
  const StandInCluster cluster([](SweepPlan& plan) {
    for (std::size_t i = 0; i < plan.runs.size(); ++i) plan.runs[i].rung = i / 2;
  });
  const SlurmJobs jobs = cluster.submit();
  CHECK(jobs.arrays == std::vector<std::string>{"101", "102"});
  CHECK_THAT(cluster.asked()[0], Contains("--array=0-1 ") && !Contains("--dependency"));
  CHECK_THAT(cluster.asked()[1], Contains("--array=2-3 ") && Contains("--dependency=afterany:101 "));
  CHECK_THAT(cluster.asked()[2], Contains("--dependency=afterany:101:102 "));
}

TEST_CASE("a run that was lost gets twice the memory where the sweep asks for that") {
  const StandInCluster cluster([](SweepPlan& plan) {
    plan.memory_mb = 300;
    plan.memory_retries = 2;
  });
  const auto note = [&](std::size_t run, const char* event) {
    SweepClaim(cluster.made.paths(), cluster.made.id(run), {}).note(event);
  };
  note(1, "start");
  for (int i = 0; i < 3; ++i) note(2, "start");
  note(3, "start");
  note(3, "failed");  // it could tell why
  CHECK(cluster.submit().arrays.size() == 3);
  CHECK_THAT(cluster.asked()[0], Contains("--array=0,3 ") && Contains("--mem=300M "));
  CHECK_THAT(cluster.asked()[1], Contains("--array=1 ") && Contains("--mem=600M "));
  CHECK_THAT(cluster.asked()[2], Contains("--array=2 ") && Contains("--mem=1200M "));
}

TEST_CASE("memory that a sweep does not name cannot be doubled") {
  const StandInCluster cluster([](SweepPlan& plan) { plan.memory_retries = 1; });
  CHECK_THROWS_WITH(cluster.submit(),
                    Contains("memory_retries doubles what a run gets, and the sweep names no memory_mb"));
}

TEST_CASE("a sweep that does not say a whole number of MB asks for enough") {
  SweepPlan plan;
  plan.name = "tiny";
  plan.memory_mb = 0.5;
  const std::vector<std::string> options = array_options({"/out"}, plan, {0}, 0, 1);
  CHECK(std::find(options.begin(), options.end(), "--mem=1M") != options.end());
}

TEST_CASE("a job's number is taken from a line of its own") {
  CHECK(job_number("123\n") == "123");
  CHECK(job_number("123;cluster\n") == "123");
  CHECK(job_number("sbatch: a warning\n 45 \nsbatch: 2 nodes are drained\n") == "45");
  for (const char* none : {"", "Submitted batch job 12", "12 13", "12;", "12;a b", "-3", "1\n2\n"}) {
    INFO(none);
    CHECK_THROWS_WITH(job_number(none), Catch::Contains("job's number on a line of its own"));
  }
}

}  // namespace slurm_test
