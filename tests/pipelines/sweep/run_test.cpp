// Sweeps by the program: launched, killed at moments that nobody chose, gone on with.
#include <algorithm>
#include <csignal>

#include <catch2/catch.hpp>

#include "core/random.h"
#include "pipelines/sweep/folder.h"
#include "pipelines/sweep/slurm.h"
#include "tests/support/program.h"
#include "tests/support/running_program.h"
#include "tests/support/tiny_sweep.h"

namespace run_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
using Catch::Matchers::EndsWith;
using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

namespace {

const std::vector<std::string> kNone;

std::vector<std::string> sweep_words(const std::string& out, bool resume = true) {
  std::vector<std::string> words = {"sweep", "sweep.json", "--out", out, "--jobs", "2", "--threads", "2"};
  if (resume) words.emplace_back("--resume");
  return words;
}

ProgramResult run_sweep(const std::string& out, bool resume = true) { return run_hsi4d(sweep_words(out, resume)); }

/// Processes that compute runs of a sweep, by what its attempts tell of the last start.
std::vector<pid_t> processes_of(const std::string& sweep) {
  std::vector<pid_t> processes;
  if (!fs::exists(SweepPaths{sweep}.plan())) return processes;
  for (const std::string& id : ids_of(sweep)) {
    std::istringstream text(file_text(SweepPaths{sweep}.attempts(id)));
    Json last;
    for (std::string line; std::getline(text, line);) {
      Json attempt = Json::parse(line, nullptr, false);
      if (attempt.is_object()) last = std::move(attempt);
    }
    if (last.is_object() && last["event"] == "start" && is_claimed(SweepPaths{sweep}, id))
      processes.push_back(last["process"].get<pid_t>());
  }
  return processes;
}

/// What differs in two runs but for their configs, which name datasets in different folders.
std::vector<std::string> differing_results(const fs::path& a, const fs::path& b) {
  std::vector<std::string> names = differences(a, b);
  std::erase(names, "config.resolved.json");
  return names;
}

/// Every run of the sweep was computed to its end once, and is as that of another sweep which nobody has stopped.
void check_complete(const std::string& sweep, const std::string& whole) {
  const std::vector<std::string> ids = ids_of(sweep);
  CHECK(ids == ids_of(whole));
  for (const std::string& id : ids) {
    INFO("run " << id << "\n" << file_text(SweepPaths{sweep}.attempts(id)));
    const fs::path run = fs::path(sweep) / "runs" / id;
    CHECK(sweep_run_state({sweep}, id) == SweepRunState::kDone);
    CHECK(events_of(sweep, id)["done"] == 1);
    CHECK(events_of(sweep, id)["failed"] == 0);
    CHECK(times_done(run) <= 1);  // a kill may come between the report and the last line of the log
    CHECK(fs::exists(run / "report.html"));
    CHECK(differing_results(run, fs::path(whole) / "runs" / id) == kNone);
  }
  CHECK(std::distance(fs::directory_iterator(fs::path(sweep) / "runs"), {}) == std::ssize(ids));
  CHECK(temporaries_in(sweep) == kNone);
  const std::string csv = file_text(fs::path(sweep) / "results.csv");
  CHECK(std::count(csv.begin(), csv.end(), '\n') == std::ssize(ids) + 1);
}

/// Files that a sweep has written: how far it has come, whatever else the machine does.
int files_in(const std::string& sweep) {
  int files = 0;
  std::error_code error;
  for (fs::recursive_directory_iterator it(sweep, error), end; !error && it != end; it.increment(error)) ++files;
  return files;
}

/// Kills a sweep `kills` times at random moments, every second time with all that it computes, goes on with it and
/// checks what it came to. How many of the kills found it running.
int kill_and_check(const std::string& out, const std::string& whole, int kills, std::uint64_t seed) {
  const int all = files_in(whole);
  RandomSequence random(seed);
  int killed = 0;
  for (int i = 0; i < kills; ++i) {
    const int before = files_in(out);
    const int until =
        before + 1 +
        static_cast<int>(random.below(static_cast<std::uint64_t>(std::max(1, (all - before) / (kills - i)))));
    RunningProgram program(sweep_words(out));
    const bool was_killed = program.signal_at(SIGKILL, [&] { return files_in(out) >= until; });
    INFO(program.text());
    killed += was_killed ? 1 : 0;
    if (i % 2 == 0) {
      for (const pid_t process : processes_of(out)) ::kill(process, SIGKILL);
    }
  }
  const ProgramResult last = run_sweep(out);
  INFO(last.err);
  CHECK(last.status == 0);
  check_complete(out, whole);
  return killed;
}

/// As above, again from the beginning where a sweep was done before a kill came: all kills must have found one running.
void check_kills(const std::string& out, const std::string& whole, int kills, std::uint64_t seed) {
  int killed = 0;
  for (std::uint64_t attempt = 0; attempt < 5 && killed < kills; ++attempt) {
    fs::remove_all(out);
    killed = kill_and_check(out, whole, kills, seed + 1000 * attempt);
  }
  CHECK(killed == kills);
}

}  // namespace

TEST_CASE("a sweep is computed, recognised and reported", "[release]") {
  const TemporaryFolder here;
  write_tiny_base(2);
  write_sweep({{"seeds", 1}, {"ablations", {{"plain", Json::object()}, {"less", {{"stages.camera.iterations", 2}}}}}});
  const ProgramResult dry = run_hsi4d({"sweep", "sweep.json", "--out", "out", "--dry-run"});
  CHECK(dry.status == 0);
  CHECK_THAT(dry.out,
             Contains("plain, seed 0  new\n") &&
                 Contains("sweep tiny: 2 combinations, 2 runs, 0 done; 1 dataset to be generated; folder out\n"));
  CHECK_FALSE(fs::exists("out"));
  const ProgramResult first = run_sweep("out", false);
  INFO(first.err);
  REQUIRE(first.status == 0);
  CHECK_THAT(first.err, Contains("1/2 run ") && Contains("2/2 run ") && Contains(": done in "));
  CHECK_THAT(first.out, Contains("## Differences to plain") && Contains("report: out/report.html\n"));
  CHECK(std::distance(fs::directory_iterator("out/data"), {}) == 1);
  CHECK(run_sweep("out", false).err ==
        "out: holds a sweep already; --resume goes on with it, another --out makes a new one\n");
  const ProgramResult again = run_hsi4d({"sweep", "out", "--resume"});
  CHECK(again.status == 0);
  CHECK(again.err == "2 of 2 runs are done already\n");
  CHECK(again.out == first.out);
  CHECK(run_hsi4d({"sweep", "out", "--resume", "--quiet"}).err.empty());
  const fs::path report = fs::path(SweepPaths{"out"}.run(ids_of("out")[0])) / "report.html";
  fs::remove(report);  // killed after its results, before its report
  CHECK(run_sweep("out").status == 0);
  CHECK(fs::exists(report));
  const ProgramResult one = run_hsi4d({"run-one", "out", "1"});
  CHECK(one.status == 0);
  CHECK_THAT(one.out, Contains("report: out/runs/" + ids_of("out")[1] + "/report.html\n"));
  CHECK(run_hsi4d({"run-one", "out", "2"}).err == "hsi4d run-one: there is no run 2 in out; allowed: 0 to 1\n");
  for (const std::string& id : ids_of("out"))
    CHECK(events_of("out", id) == std::map<std::string, int>{{"start", 1}, {"done", 1}});
  CHECK(run_hsi4d({"report", "out"}).out == first.out);
}

TEST_CASE("a sweep that is killed before its plan is written goes on") {
  const TemporaryFolder here;
  here.write("out/.lock", "");
  here.write("out/configs/left.json.tmp", "{");
  here.write("out/plans/left.json", "{}");
  CHECK_NOTHROW(check_sweep_folder({"out"}, true));
  CHECK_THROWS_WITH(check_sweep_folder({"out"}, false), Contains("holds a sweep already"));
  here.write("out/notes.txt", "mine");
  CHECK_THROWS_WITH(check_sweep_folder({"out"}, true), "out: holds something that is no sweep; choose another folder");
}

TEST_CASE("a run that fails does not keep the others from being computed", "[release]") {
  const TemporaryFolder here;
  write_tiny_base(2);
  here.write("broken.ply", "ply\nformat ascii 1.0\n");
  write_sweep({{"ablations", {{"bad", {{"data.scene", "broken.ply"}}}, {"good", Json::object()}}},
               {"clips", {{"real", tiny_config_file()}}}});
  const ProgramResult result = run_sweep("out", false);
  CHECK(result.status == 2);
  CHECK_THAT(result.err, Contains("run 0, real, bad: failed: ") && Contains("broken.ply") &&
                             Contains("run 1, real, good: done in "));
  CHECK_THAT(result.out, Contains("- run 0, real, bad: failed, ") && Contains("2 runs: 1 done, 1 failed\n"));
  CHECK_THAT(file_text("out/sweep.log"), Contains("bad: failed: "));
  std::vector<std::string> words = {"sweep", "sweep.json", "--out", "fast", "--jobs", "1", "--fail-fast"};
  const ProgramResult fast = run_hsi4d(words);
  CHECK(fast.status == 2);
  CHECK_THAT(fast.out, Contains("1 run not computed, after the failure\n"));
  CHECK(events_of("fast", ids_of("fast")[1]).empty());
}

TEST_CASE("a sweep that is interrupted saves the state of its runs", "[release]") {
  const TemporaryFolder here;
  write_tiny_base();
  write_sweep({{"seeds", 2}, {"set", {{"stages.interaction.iterations", 60}}}});
  RunningProgram program(sweep_words("out", false));
  const bool was_interrupted = program.signal_at(SIGINT, [] { return !processes_of("out").empty(); });
  INFO(program.text());
  REQUIRE(was_interrupted);
  CHECK(program.result() == 130);
  CHECK_THAT(program.text(), Contains("hsi4d sweep out --resume goes on\n"));
  for (const std::string& id : ids_of("out")) CHECK_FALSE(is_claimed({"out"}, id));
  CHECK(run_sweep("out").status == 0);
  for (const std::string& id : ids_of("out")) CHECK(events_of("out", id)["done"] == 1);
}

TEST_CASE("a run that was killed at its very end is completed", "[release]") {
  const TemporaryFolder here;
  write_tiny_base(2);
  write_sweep({{"set", {{"stages.camera.iterations", 1}, {"stages.interaction.iterations", 1}}}});
  REQUIRE(run_sweep("out", false).status == 0);
  const SweepPaths paths{"out"};
  const std::string id = ids_of("out")[0];
  const RunPaths run{paths.run(id)};
  const std::string attempts = file_text(paths.attempts(id)), status = file_text(run.status());
  const std::string start = attempts.substr(0, attempts.find('\n') + 1);
  // Before its end was noted; while the report was written; before its state was; with a line of the attempts cut.
  here.write(paths.attempts(id), start);
  CHECK(run_sweep("out").status == 0);
  CHECK(events_of("out", id) == std::map<std::string, int>{{"start", 1}, {"done", 1}});
  fs::rename(run.report(), run.report() + ".1-2.tmp");
  CHECK(run_sweep("out").status == 0);
  CHECK(fs::exists(run.report()));
  CHECK(temporaries_in("out") == kNone);
  CHECK(events_of("out", id) == std::map<std::string, int>{{"start", 1}, {"done", 1}});
  here.write(paths.attempts(id), start + attempts.substr(0, 20));
  here.write(run.status(), std::string(status).replace(status.find("done"), 4, "running"));
  fs::remove(run.report());
  const ProgramResult last = run_sweep("out");
  INFO(last.err);
  CHECK(last.status == 0);
  CHECK(events_of("out", id) == std::map<std::string, int>{{"start", 2}, {"done", 1}});
  CHECK(sweep_run_state(paths, id) == SweepRunState::kDone);
}

TEST_CASE("a damaged config of a run is written anew, and another one refused", "[release]") {
  const TemporaryFolder here;
  write_tiny_base(2);
  write_sweep({{"set", {{"stages.camera.iterations", 1}, {"stages.interaction.iterations", 1}}}});
  REQUIRE(run_hsi4d({"sweep", "sweep.json", "--out", "out"}).status == 0);
  const std::string id = ids_of("out")[0], config = SweepPaths{"out"}.config(id), text = file_text(config);
  fs::remove_all(SweepPaths{"out"}.run(id));
  const std::string other = std::string(text).replace(text.find("0.13"), 4, "0.14");
  here.write(config, other);
  CHECK(run_hsi4d({"run-one", "out", "0"}).err ==
        config + ": has other settings than the run; hsi4d sweep SWEEP.json --out out --resume writes it anew\n");
  for (const std::string& damaged : {std::string(), text.substr(0, 99), other}) {
    here.write(config, damaged);
    const ProgramResult result = run_sweep("out");
    INFO(result.err);
    CHECK(result.status == 0);
    CHECK_THAT(result.err, Contains("anew"));
    CHECK(file_text(config) == text);
  }
}

TEST_CASE("options that Slurm's launcher would pass over are refused") {
  const TemporaryFolder here;
  write_tiny_base(2);
  write_sweep({{"seeds", 1}});
  CHECK(run_hsi4d({"sweep", "sweep.json", "--launcher", "slurm", "--fail-fast"}).err ==
        "hsi4d sweep: --fail-fast is of the launcher \"local\"; of Slurm, scancel ends what runs\n");
  CHECK(run_hsi4d({"sweep", "sweep.json", "--launcher", "slurm", "--memory", "9"}).err ==
        "hsi4d sweep: --memory is of the launcher \"local\"; of Slurm, memory_mb of the sweep's file is what a run "
        "gets\n");
  CHECK(run_hsi4d({"sweep", "sweep.json", "--launcher", "slurm", "--quiet"}).err ==
        "hsi4d sweep: --quiet is of the launcher \"local\"; of Slurm, each run has a log of its own\n");
  CHECK_FALSE(fs::exists("runs"));
}

TEST_CASE("two launchers share a sweep", "[release]") {
  const TemporaryFolder here;
  write_tiny_base(2);
  write_sweep({{"seeds", 4}});
  RunningProgram other(sweep_words("out"));
  while (other.is_running() && !fs::exists("out/sweep.json")) ::usleep(1000);
  const ProgramResult one = run_sweep("out");
  INFO(one.err);
  CHECK(one.status == 0);
  while (other.is_running()) ::usleep(1000);  // it ends by itself, or the time of the test does
  CHECK(other.result() == 0);
  for (const std::string& id : ids_of("out"))
    CHECK(events_of("out", id) == std::map<std::string, int>{{"start", 1}, {"done", 1}});
}

TEST_CASE("a sweep that is killed goes on", "[release]") {
  const TemporaryFolder here;
  write_tiny_base(2);
  write_sweep({{"seeds", 2}, {"ablations", {{"plain", Json::object()}, {"less", {{"stages.camera.iterations", 2}}}}}});
  REQUIRE(run_sweep("whole", false).status == 0);
  check_kills("out", "whole", 2, 1);
}

TEST_CASE("24 runs killed ten times are computed once each", "[full]") {
  const TemporaryFolder here;
  write_tiny_base();
  write_sweep({{"seeds", 12}, {"ablations", {{"plain", Json::object()}, {"less", {{"stages.camera.iterations", 2}}}}}});
  REQUIRE(run_sweep("whole", false).status == 0);
  check_kills("out", "whole", 10, 7);
}

TEST_CASE("what Slurm is asked for") {
  CHECK(array_text({0, 1, 2, 5, 7, 8}) == "0-2,5,7-8");
  CHECK(array_text({4}) == "4");
  SweepPlan plan;
  plan.name = "tiny";
  plan.memory_mb = 700;
  plan.slurm.time = "01:00:00";
  plan.slurm.at_once = 5;
  plan.slurm.options = {"--account=x"};
  std::vector<std::string> options = array_options({"/a b/50%"}, plan, {0, 1}, 0, 3);
  CHECK_THAT(options.at(1), Contains("--comment=hsi4d:") && EndsWith(".json"));
  options.erase(options.begin() + 1);
  CHECK(options == std::vector<std::string>{"--job-name=tiny", "--array=0-1%5", "--output=/a b/50%%/slurm/%A_%a.txt",
                                            "--open-mode=append", "--requeue", "--ntasks=1", "--cpus-per-task=3",
                                            "--signal=B:USR1@120", "--mem=700M", "--time=01:00:00", "--account=x"});
}

}  // namespace run_test
