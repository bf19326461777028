// The program, stopped by signals at moments that nobody chose, and resumed.
#include <algorithm>
#include <chrono>
#include <csignal>
#include <optional>

#include <catch2/catch.hpp>

#include "core/random.h"
#include "tests/support/program.h"
#include "tests/support/running_program.h"
#include "tests/support/tiny_run.h"

namespace interrupt_test {

using namespace hsi4d;
using namespace hsi4d::test;
namespace fs = std::filesystem;

namespace {

using Clock = std::chrono::steady_clock;

const std::vector<std::string> kNone;

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

constexpr int kStepsOfFile = 4;  // what a file counts in steps_of: as much as so many iterations

/// How far a run has come: iterations and files that it has written. Other than time it does not depend on what else
/// the machine does.
int steps_of(const std::string& run) {
  const std::string metrics = file_text(run + "/metrics.jsonl");
  auto steps = static_cast<int>(std::count(metrics.begin(), metrics.end(), '\n'));
  std::error_code error;
  for (fs::recursive_directory_iterator it(run, error), end; !error && it != end; it.increment(error))
    steps += kStepsOfFile;
  return steps;
}

/// The config of the tiny dataset with a preview, a color net that moves, and a stage over the sequence.
std::string write_every_kind_of_stage() {
  const fs::path file = TinyDataset::folder() / "every_stage.json";
  write_changed(tiny_config_file(), file, [](nlohmann::ordered_json& config) {
    config["log"]["preview"] = true;
    config["color_net"]["use"] = "on";
    config["stages"]["interaction"]["optimize"]["color_net"] = {{"lr", 0.003}, {"every", 2}};
    config["stages"]["refinement"] = nlohmann::ordered_json::parse(R"({
      "over": "sequence", "iterations": 40, "optimize": {"transl": {"lr": 0.01}, "pose_latents": {"lr": 0.01}},
      "losses": {"fit": {}, "contact": {"weight": 0.05}, "smooth": {"weight": 0.005}}})");
  });
  return file.string();
}

std::vector<std::string> arguments_for(const std::string& out, bool resume = true) {
  static const std::string config = write_every_kind_of_stage();
  std::vector<std::string> words = {"run", config, "--out", out, "--threads", "1"};
  if (resume) words.emplace_back("--resume");
  return words;
}

/// Everything that two runs must have in common: also the nets that frames have left beside the checkpoint.
std::vector<std::string> all_differences(const std::string& a, const std::string& b) {
  std::vector<std::string> names = differences(a, b);
  for (const auto& entry : fs::directory_iterator(fs::path(a) / "checkpoint")) {
    const fs::path other = fs::path(b) / "checkpoint" / entry.path().filename();
    if (entry.path().extension() == ".safetensors" && file_text(entry.path()) != file_text(other))
      names.push_back(other.string());
  }
  return names;
}

/// What a signal did to a program that was writing a run.
enum class Fate { kDone, kStopped, kKilled };

/// Goes on with the run (or begins it) and sends it the signal once `moment` has come; checks how it ended.
template <class F>
Fate run_until(const std::string& run, int signal, F&& moment) {
  const std::string before = file_text(run + "/log.txt");
  RunningProgram program(arguments_for(run));
  program.signal_at(signal, moment);
  const int result = program.result();
  INFO(program.text());
  if (result == -SIGKILL && signal == SIGKILL) return Fate::kKilled;
  if (result == -SIGINT && signal == SIGINT) {  // it had not begun to watch: nothing was touched
    CHECK(file_text(run + "/log.txt") == before);
    return Fate::kKilled;
  }
  CHECK((result == 0 || (result == 130 && signal == SIGINT)));
  CHECK(json_of(run + "/status.json")["state"] == (result == 0 ? "done" : "interrupted"));
  CHECK(temporaries_in(run) == kNone);
  return result == 0 ? Fate::kDone : Fate::kStopped;
}

/// Goes on to the end; the run is then as one that was never stopped.
void check_resumes(const std::string& run) {
  const ProgramResult result = run_hsi4d(arguments_for(run));
  INFO(result.err);
  CHECK(result.status == 0);
  CHECK(json_of(run + "/status.json")["state"] == "done");
  CHECK(temporaries_in(run) == kNone);
  CHECK(all_differences("whole", run) == kNone);
}

/// Writes "whole", never stopped.
void run_whole() {
  const ProgramResult result = run_hsi4d(arguments_for("whole", false));
  INFO(result.err);
  REQUIRE(result.status == 0);
  REQUIRE(fs::exists("whole/color_net.safetensors"));
  REQUIRE(fs::exists("whole/checkpoint/color_net_0003.safetensors"));
}

struct Tally {
  int done = 0, stopped = 0, killed = 0;
  void add(Fate fate) { ++(fate == Fate::kDone ? done : fate == Fate::kStopped ? stopped : killed); }
};

/// A moment up to 20 ms after a run has come so far.
class LittleLater {
 public:
  LittleLater(std::string run, double steps, RandomSequence& random)
      : run_(std::move(run)), steps_(steps), delay_s_(random.uniform(0, 0.02)) {}
  bool operator()() {
    if (!reached_ && steps_of(run_) >= steps_) reached_ = Clock::now();
    return reached_ && seconds_since(*reached_) >= delay_s_;
  }

 private:
  std::string run_;
  double steps_, delay_s_;
  std::optional<Clock::time_point> reached_;
};

/// Tries as many runs, each stopped at a moment of its own part of a whole one, every other one again when it was
/// resumed; SIGINT and SIGKILL in turn.
Tally interrupt_at_random(int tries) {
  run_whole();
  const int whole = steps_of("whole");
  RandomSequence random(20);
  Tally tally;
  for (int attempt = 0; attempt < tries; ++attempt) {
    const std::string run = "run" + std::to_string(attempt);
    const int signal = attempt % 2 == 0 ? SIGINT : SIGKILL;
    double steps = whole * (attempt + random.uniform(0, 1)) / tries;
    for (int stop = 0; stop <= attempt / 2 % 2; ++stop) {
      INFO("try " << attempt << ", stop " << stop << ", signal " << signal << " after " << steps << " steps of "
                  << whole);
      const Fate fate = run_until(run, signal, LittleLater(run, steps, random));
      tally.add(fate);
      if (fate == Fate::kDone) break;
      steps = random.uniform(std::min(steps_of(run), whole - 1), whole);
    }
    INFO("try " << attempt << ", signal " << signal);
    check_resumes(run);
    fs::remove_all(run);
  }
  return tally;
}

}  // namespace

TEST_CASE("a run that a signal ends at any moment goes on with the same bits", "[run][release]") {
  const TemporaryFolder here;
  const Tally tally = interrupt_at_random(2);
  CHECK(tally.stopped + tally.killed > 0);
}

TEST_CASE("twenty runs that signals end at random moments go on with the same bits", "[full][run]") {
  const TemporaryFolder here;
  const Tally tally = interrupt_at_random(20);
  INFO(tally.done << " were done before the signal, " << tally.stopped << " stopped, " << tally.killed << " killed");
  CHECK(tally.stopped >= 5);
  CHECK(tally.killed >= 5);
}

TEST_CASE("a run that a signal ends while it writes its results goes on with the same bits", "[full][run]") {
  const TemporaryFolder here;
  run_whole();
  for (const char* file : {"config.resolved.json", "checkpoint/progress.npz", "frames/0002_render.png", "motion.npz",
                           "cameras.json", "color_net.safetensors", "summary.json", "body.glb", "preview.mp4"}) {
    for (const int signal : {SIGINT, SIGKILL}) {
      INFO("signal " << signal << " as soon as there is " << file);
      run_until("run", signal, [&] { return fs::exists(fs::path("run") / file); });
      check_resumes("run");
      fs::remove_all("run");
    }
  }
}

}  // namespace interrupt_test
