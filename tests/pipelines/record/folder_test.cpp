#include "pipelines/record/folder.h"

#include <cmath>
#include <csignal>
#include <limits>
#include <sys/wait.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "core/check.h"
#include "core/version.h"
#include "tests/support/temporary_folder.h"

namespace folder_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
using Catch::Matchers::Message;
namespace fs = std::filesystem;

namespace {

const char* const kConfig =
    "{\n  \"seed\": 7,\n  \"stages\": {\n    \"camera\": {\n      \"iterations\": 30\n    }\n  }\n}\n";

RunIdentity identity() { return {kConfig, 7, 2, "double"}; }

IterationRecord record(int frame, Index iteration, double loss = 0.5) {
  return {frame, "camera", iteration, loss, {{"masked_l2", loss}}, 0.03};
}

std::string opening_message(const std::string& path, const RunIdentity& with, bool resume) {
  try {
    const RunFolder folder(path, with, resume);
  } catch (const UserError& error) {
    return error.what();
  }
  return "opened";
}

/// As if the run had been made, ended and left.
void leave_run(const std::string& path, RunState state) {
  RunFolder folder(path, identity(), false);
  for (int frame = 1; frame <= 3; ++frame)
    for (int i = 0; i < 2; ++i) folder.append_metrics(record(frame, i));
  folder.set_state(state);
}

}  // namespace

TEST_CASE("a new run folder has config, status and log") {
  const TemporaryFolder here;
  RunFolder folder("runs/a", identity(), false);
  CHECK_FALSE(folder.resumed_from().has_value());
  CHECK(file_text("runs/a/config.resolved.json") == kConfig);
  const auto status = nlohmann::json::parse(file_text("runs/a/status.json"));
  CHECK(status["state"] == "running");
  CHECK(status["version"] == version());
  CHECK(status["git"] == git_commit());
  CHECK_THAT(git_commit(), Catch::Matchers::Matches("unknown|[0-9a-f]{12,40}(-modified)?"));
  CHECK(status["seed"] == 7);
  CHECK(status["threads"] == 2);
  CHECK(status["precision"] == "double");
  CHECK_FALSE(std::string(status["host"]).empty());
  CHECK_THAT(std::string(status["started"]), Catch::Matchers::Matches("\\d{4}-\\d\\d-\\d\\dT\\d\\d:\\d\\d:\\d\\dZ"));
  CHECK(status["updated"] == status["started"]);
  log_info("to the log");
  CHECK_THAT(file_text("runs/a/log.txt"), Contains("info to the log\n"));
  CHECK(fs::is_directory("runs/a/frames"));
  CHECK(folder.paths().frame_image(7, "target") == "runs/a/frames/0007_target.png");
  CHECK(folder.paths().frame_image(12345, "render") == "runs/a/frames/12345_render.png");
  folder.set_state(RunState::kFailed, "frame 3: no mask");
  const auto failed = nlohmann::json::parse(file_text("runs/a/status.json"));
  CHECK(failed["state"] == "failed");
  CHECK(failed["message"] == "frame 3: no mask");
}

TEST_CASE("the log of a folder ends with it") {
  const TemporaryFolder here;
  { const RunFolder folder("a", identity(), false); }
  log_info("too late");
  CHECK(file_text("a/log.txt").find("too late") == std::string::npos);
}

TEST_CASE("metrics are lines of JSON, there as soon as they are appended") {
  const TemporaryFolder here;
  RunFolder folder("a", identity(), false);
  folder.append_metrics({3, "interaction", 17, 0.0123, {{"photometric", 0.011}, {"center", 1.0 / 3}}, 0.03});
  CHECK(file_text("a/metrics.jsonl") ==
        "{\"frame\": 3, \"stage\": \"interaction\", \"iteration\": 17, \"loss\": 0.0123, \"losses\": "
        "{\"photometric\": 0.011, \"center\": 0.3333333333333333}, \"seconds\": 0.03}\n");
}

TEST_CASE("a loss that is not finite is refused by name, but told of a step that was rolled back") {
  const TemporaryFolder here;
  RunFolder folder("a", identity(), false);
  IterationRecord bad = record(1, 0);
  bad.losses.front().second = std::nan("");
  CHECK_THROWS_WITH(folder.append_metrics(bad), Contains("metrics.jsonl: /losses/masked_l2: nan is not finite"));
  CHECK(file_text("a/metrics.jsonl").empty());
  bad.rolled_back = true;
  folder.append_metrics(bad);
  const auto line = nlohmann::json::parse(file_text("a/metrics.jsonl"));
  CHECK(line["losses"]["masked_l2"].is_null());
  CHECK(line["loss"] == 0.5);
  CHECK(line["rolled_back"] == true);
  CHECK_FALSE(line.contains("matrix"));
}

TEST_CASE("what a method with a matrix tells is in the line of its iteration") {
  const TemporaryFolder here;
  RunFolder folder("a", identity(), false);
  IterationRecord told = record(1, 0);
  told.matrix = {0.75, 0.01, HUGE_VAL, true};
  folder.append_metrics(told);
  const auto line = nlohmann::json::parse(file_text("a/metrics.jsonl"));
  CHECK(line["matrix"] ==
        nlohmann::json({{"gain_ratio", 0.75}, {"damping", 0.01}, {"condition", nullptr}, {"refused", true}}));
}

TEST_CASE("a folder that holds something is refused without resume") {
  const TemporaryFolder here;
  leave_run("a", RunState::kDone);
  CHECK(opening_message("a", identity(), false) ==
        "a: holds a run that is done; choose another folder, remove this one, or go on with it by --resume");
  leave_run("b", RunState::kInterrupted);
  CHECK(opening_message("b", identity(), false) ==
        "b: holds a run that is not finished (interrupted); choose another folder, remove this one, or go on with it "
        "by --resume");
  here.write("thesis/chapter.tex", "x");
  for (const bool resume : {false, true})
    CHECK(opening_message("thesis", identity(), resume) ==
          "thesis: is not empty and holds no run (\"chapter.tex\" is in it); choose another folder");
  CHECK_FALSE(fs::exists("thesis/.lock"));  // left as it was
  here.write("file", "x");
  CHECK(opening_message("file", identity(), false) == "file: is a file; a run needs a folder");
  CHECK_THAT(opening_message("file/a", identity(), false), Contains("file/a: "));
}

TEST_CASE("an empty folder, and the traces of a run killed at once, are no obstacle") {
  const TemporaryFolder here;
  fs::create_directory("empty");
  CHECK(opening_message("empty", identity(), false) == "opened");
  here.write("traces/.lock", "");
  here.write("traces/config.resolved.json.123-0.tmp", "{");
  CHECK(opening_message("traces", identity(), false) == "opened");
  CHECK_FALSE(fs::exists("traces/config.resolved.json.123-0.tmp"));
  CHECK(opening_message("fresh", identity(), true) == "opened");  // nothing to resume: a start
}

TEST_CASE("a run is resumed where its config is the same") {
  const TemporaryFolder here;
  leave_run("a", RunState::kInterrupted);
  here.write("a/summary.json.9-9.tmp", "half");
  const auto before = nlohmann::json::parse(file_text("a/status.json"));
  RunFolder folder("a", identity(), true);
  CHECK(folder.resumed_from() == RunState::kInterrupted);
  CHECK_FALSE(fs::exists("a/summary.json.9-9.tmp"));
  const auto status = nlohmann::json::parse(file_text("a/status.json"));
  CHECK(status["state"] == "running");
  CHECK(status["started"] == before["started"]);
  CHECK(status.contains("resumed"));
  CHECK_FALSE(before.contains("resumed"));
}

TEST_CASE("a config that differs is told setting by setting") {
  const TemporaryFolder here;
  leave_run("a", RunState::kFailed);
  RunIdentity other = identity();
  other.config =
      "{\n  \"seed\": 8,\n  \"stages\": {\n    \"camera\": {\n      \"iterations\": 30,\n      \"lr\": 0.1\n    }\n  "
      "}\n}\n";
  CHECK(opening_message("a", other, true) ==
        "a/config.resolved.json: the run cannot be resumed, its config is another one:\n"
        "  /seed: 7 in the folder, 8 now\n"
        "  /stages/camera/lr: absent in the folder, 0.1 now");
  // The same in another form, for another number of threads, beside another dataset to be made.
  other.config =
      "{\"seed\": 7, \"threads\": 3, \"synthetic\": {\"seed\": 4}, \"stages\": {\"camera\": {\"iterations\": 30}}}";
  CHECK(opening_message("a", other, true) == "opened");
  CHECK(file_text("a/config.resolved.json") == kConfig);  // until somebody takes the other over
  here.write("a/config.resolved.json", "{\"seed\":");
  CHECK_THAT(opening_message("a", identity(), true), Contains("(in its text only)"));
}

TEST_CASE("a config with its stages in another order is another one") {
  const TemporaryFolder here;
  const auto config = [](const std::string& stages) { return "{\"seed\": 7, \"stages\": {" + stages + "}}"; };
  const std::string first = "\"first\": {\"iterations\": 1}", second = "\"second\": {\"iterations\": 2}";
  RunIdentity before = identity(), now = identity();
  before.config = config(first + ", " + second);
  now.config = config(second + ", " + first);
  CHECK(opening_message("a", before, false) == "opened");
  CHECK(opening_message("a", now, true) ==
        "a/config.resolved.json: the run cannot be resumed, its config is another one:\n"
        "  /stages: in the order first, second in the folder, second, first now");
  CHECK(opening_message("a", before, true) == "opened");
  now.config = "{\"stages\": {" + first + ", " + second + "}, \"seed\": 7}";  // sections have no order
  CHECK(opening_message("a", now, true) == "opened");
}

namespace {

/// Keeps the lines of frames up to one.
void keep_up_to(RunFolder& folder, int last) {
  folder.keep_metrics([last](const std::string&, std::optional<int> frame) { return frame && *frame <= last; });
}

}  // namespace

TEST_CASE("after truncation the metrics are as if the run had never gone further") {
  const TemporaryFolder here;
  leave_run("whole", RunState::kDone);
  const std::string whole = file_text("whole/metrics.jsonl");
  for (const size_t cut : {whole.size(), whole.size() - 1, whole.size() - 40, whole.size() / 2 + 20}) {
    INFO(cut);
    leave_run("a", RunState::kInterrupted);
    here.write("a/metrics.jsonl", whole.substr(0, cut));
    {
      RunFolder folder("a", identity(), true);
      const auto lines = std::count(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(cut), '\n');
      const int checkpoint = static_cast<int>(lines / 2) < 3 ? static_cast<int>(lines / 2) : 1;
      keep_up_to(folder, checkpoint);
      for (int frame = checkpoint + 1; frame <= 3; ++frame)
        for (int i = 0; i < 2; ++i) folder.append_metrics(record(frame, i));
    }
    CHECK(file_text("a/metrics.jsonl") == whole);
    fs::remove_all("a");
  }
  RunFolder folder("whole", identity(), true);
  keep_up_to(folder, 0);
  CHECK(file_text("whole/metrics.jsonl").empty());
}

TEST_CASE("lines of metrics are kept by their stage and frame") {
  const TemporaryFolder here;
  RunFolder folder("a", identity(), false);
  here.write("a/metrics.jsonl",
             "{\"frame\": 1, \"stage\": \"a\"}\n{\"stage\": \"all\"}\n{\"frame\": 1, \"stage\": \"b\"}\n"
             "{\"frame\": 2, \"stage\": \"b\"}\n");
  folder.keep_metrics(
      [](const std::string& stage, std::optional<int> frame) { return !frame || (stage == "b" && *frame == 1); });
  CHECK(file_text("a/metrics.jsonl") == "{\"stage\": \"all\"}\n{\"frame\": 1, \"stage\": \"b\"}\n");
}

TEST_CASE("a line of metrics that is none of ours is told with its number") {
  const TemporaryFolder here;
  RunFolder folder("a", identity(), false);
  folder.append_metrics(record(1, 0));
  const std::string good = file_text("a/metrics.jsonl");
  here.write("a/metrics.jsonl", good + "{\"frame\": 1,, }\n" + good);
  CHECK_THROWS_WITH(keep_up_to(folder, 1), Catch::Matchers::StartsWith("a/metrics.jsonl:2:"));
  here.write("a/metrics.jsonl", good + good + "{\"iteration\": 1}\n");
  CHECK_THROWS_MATCHES(
      keep_up_to(folder, 1), DataError,
      Message("a/metrics.jsonl:3:1: there is no \"stage\"") || Message("a/metrics.jsonl:3: there is no \"stage\""));
}

TEST_CASE("two runs never write the same folder") {
  const TemporaryFolder here;
  {
    const RunFolder folder("a", identity(), false);
    CHECK(is_run_locked("a"));
    for (const bool resume : {false, true}) CHECK_THAT(opening_message("a", identity(), resume), Contains("a: "));
    CHECK(opening_message("a", identity(), true) ==
          "a: another process is writing this run; wait for it, or choose another folder");
  }
  CHECK_FALSE(is_run_locked("a"));
  CHECK_FALSE(is_run_locked("nowhere"));
  CHECK(opening_message("a", identity(), true) == "opened");
}

TEST_CASE("the lock of a process that was killed is gone") {
  const TemporaryFolder here;
  int ready[2];
  REQUIRE(pipe(ready) == 0);
  const pid_t child = fork();
  REQUIRE(child >= 0);
  if (child == 0) {
    const RunFolder folder("a", identity(), false);
    (void)!write(ready[1], "x", 1);
    for (;;) pause();
  }
  char byte = 0;
  CHECK(read(ready[0], &byte, 1) == 1);
  CHECK(is_run_locked("a"));
  CHECK_THAT(opening_message("a", identity(), true), Contains("another process is writing this run"));
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  close(ready[0]);
  close(ready[1]);
  CHECK_FALSE(is_run_locked("a"));
  RunFolder folder("a", identity(), true);
  CHECK(folder.resumed_from() == RunState::kRunning);
}

TEST_CASE("the summary is written whole or not at all") {
  const TemporaryFolder here;
  RunFolder folder("a", identity(), false);
  RunSummary summary;
  summary.name = "a";
  summary.metrics = {{"camera", 1, 30, {{"camera_rotation_deg", 0.5}}}};
  folder.write_summary(summary);
  const std::string text = file_text("a/summary.json");
  CHECK(text == summary_json(summary));
  summary.metrics[0].values[0].second = std::numeric_limits<double>::infinity();
  CHECK_THROWS_AS(folder.write_summary(summary), InternalError);
  CHECK(file_text("a/summary.json") == text);
}

}  // namespace folder_test
