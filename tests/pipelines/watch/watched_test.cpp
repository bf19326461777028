// What is told of runs, from made folders, broken ones too.
#include "pipelines/watch/watched.h"

#include <filesystem>
#include <fstream>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "core/check.h"
#include "pipelines/watch/answers.h"
#include "tests/support/made_sweep.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tiny_run.h"

namespace watched_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
using nlohmann::json;
namespace fs = std::filesystem;

namespace {

const std::string kLine =
    R"({"frame": 1, "stage": "camera", "iteration": 0, "loss": 0.5, "losses": {"masked_l2": 0.5}, "tiles": 3, "seconds": 0.25})"
    "\n";
const json kRow = {1.0, "camera", 0, 0.5, 0.25, {{"masked_l2", 0.5}}};

std::vector<std::string> ids_of(const std::string& path) {
  std::vector<std::string> ids;
  for (const WatchedRun& run : watched_runs(path)) ids.push_back(run.id);
  return ids;
}

WatchedRun the_run(const std::string& path) {
  const std::vector<WatchedRun> runs = watched_runs(path);
  REQUIRE(runs.size() == 1);
  return runs.front();
}

json metrics_of_run(const WatchedRun& run, std::int64_t from = 0, const std::string& file = "") {
  return json::parse(watched_metrics_json(run, {file, from}));
}

void make_run(const TemporaryFolder& here, const std::string& folder, const std::string& state = "running") {
  here.write(folder + "/config.resolved.json", R"({"stages": {"camera": {"iterations": 8}, "interaction": null}})");
  here.write(folder + "/status.json",
             R"({"state": ")" + state + R"(", "message": "why", "started": "2026-01-01T00:00:00Z"})");
  here.write(folder + "/log.txt", "T info hsi4d 0.1.0 (x), run 'of 3 frames': 16 frames of 48x48 pixels, 1 stages\n");
}

}  // namespace

TEST_CASE("what is no run, and no folder, is refused by name") {
  const TemporaryFolder here;
  here.write("other/notes.txt", "x");
  fs::create_directory("empty");
  CHECK_THROWS_WITH(check_watched("nowhere"), "nowhere: there is no such folder");
  CHECK_THROWS_WITH(check_watched("other/notes.txt"), "other/notes.txt: there is no such folder");
  CHECK_THROWS_WITH(check_watched("other"), "other: holds no run, sweep or chain");
  CHECK_NOTHROW(check_watched("empty"));  // a run may begin there
  CHECK(json::parse(watched_runs_json("empty"))["runs"].empty());
  make_run(here, "empty");
  CHECK(ids_of("empty") == std::vector<std::string>{""});
}

TEST_CASE("runs are found in folders, chains and sweeps") {
  const TemporaryFolder here;
  make_run(here, "runs/b/run");
  make_run(here, "runs/a");
  make_run(here, "runs/.hidden");
  make_run(here, "runs/1/2/3/4");  // too deep
  here.write("runs/c/config.resolved.json", R"({"chain": [{"name": "first"}, {"name": "second"}]})");
  here.write("runs/broken/config.resolved.json", "{");
  CHECK(ids_of("runs") == std::vector<std::string>{"a", "b/run", "broken", "c/clips/first", "c/clips/second"});
  CHECK(ids_of("runs/") == ids_of("runs"));
  CHECK(ids_of("runs/a/.") == std::vector<std::string>{""});
  CHECK(json::parse(watched_runs_json("runs/"))["title"] == "runs");
  CHECK(json::parse(watched_run_json(the_run("runs/broken")))["stages"].empty());
}

TEST_CASE("the table of a sweep has runs of every state, with their results") {
  MadeSweep sweep;
  sweep.here().write("made/attempts/" + sweep.id(1) + ".jsonl", R"({"event": "start"})"
                                                                "\n"
                                                                R"({"event": "failed", "message": "no memory"})"
                                                                "\n{\"eve");
  sweep.here().write("made/attempts/" + sweep.id(2) + ".jsonl", R"({"event": "start"})");
  sweep.finish(0, 12.5);
  const json told = json::parse(watched_runs_json("made"));
  REQUIRE(told["runs"].size() == 12);
  CHECK(told["metrics"] ==
        json::parse(R"([{"name": "mpjpe_mm", "label": "MPJPE, mm ↓", "decimals": 1, "better": -1}])"));
  CHECK(told["runs"][0]["name"] == "a, plain, seed 0");
  CHECK(told["runs"][0]["id"] == "runs/" + sweep.id(0));
  CHECK(told["runs"][0]["state"] == "done");
  CHECK(told["runs"][0]["values"] == json{{"mpjpe_mm", 12.5}});
  CHECK(told["runs"][1]["state"] == "failed");
  CHECK(told["runs"][1]["message"] == "no memory");
  CHECK(told["runs"][2]["state"] == "started");
  CHECK(told["runs"][3]["state"] == "new");
  CHECK(told["runs"][3]["values"].empty());
}

TEST_CASE("how a run stands is told as far as its files are there") {
  const TemporaryFolder here;
  make_run(here, "run", "failed");
  for (const char* name : {"0000_target", "0000_render", "0002_target", "0002_render", "0001_render", "x_render"})
    here.write(std::string("run/frames/") + name + ".png", "PNG");
  const json told = json::parse(watched_run_json(the_run("run")));
  CHECK(told["name"] == "run");
  CHECK(told["state"] == "failed");
  CHECK(told["message"] == "why");
  CHECK(told["total"] == 15);
  CHECK(told["stages"] == json::parse(R"([{"name": "camera", "iterations": 8}])"));
  CHECK(told["age"].get<double>() >= 0);
  REQUIRE(told["frames"].size() == 2);  // of frame 1 the input is missing
  CHECK(told["frames"][0][0] == 0);
  CHECK(told["frames"][1][0] == 2);
  CHECK(told["results"].empty());
  CHECK(json::parse(watched_runs_json("run"))["runs"][0]["frames"] == 1);  // without frame 0

  here.write("run/status.json", "{\"state\": ");
  here.write("run/summary.json", "[]");
  CHECK(json::parse(watched_run_json(the_run("run")))["state"] == "unknown");
  fs::remove("run/status.json");
  fs::remove("run/log.txt");
  const json bare = json::parse(watched_run_json(the_run("run")));
  CHECK(bare["state"] == "new");
  CHECK_FALSE(bare.contains("total"));
  CHECK_FALSE(bare.contains("age"));
}

TEST_CASE("metrics are told from where reading ended, without a line that is half written") {
  const TemporaryFolder here;
  make_run(here, "run");
  const WatchedRun run = the_run("run");
  CHECK(metrics_of_run(run) ==
        json{{"file", ""}, {"restarted", false}, {"next", 0}, {"size", 0}, {"skipped", 0}, {"rows", json::array()}});
  here.write("run/metrics.jsonl", kLine + kLine.substr(0, 20));
  const json first = metrics_of_run(run);
  CHECK(first["rows"] == json::array({kRow}));
  CHECK(first["next"] == kLine.size());
  CHECK(first["size"] == kLine.size() + 20);
  std::ofstream("run/metrics.jsonl", std::ios::app) << kLine.substr(20);
  const json second = metrics_of_run(run, first["next"], first["file"]);
  CHECK(second["rows"] == json::array({kRow}));
  CHECK(second["next"] == 2 * kLine.size());
  CHECK_FALSE(second["restarted"]);
}

TEST_CASE("a file of metrics that is another one or shorter is told anew") {
  const TemporaryFolder here;
  make_run(here, "run");
  here.write("run/metrics.jsonl", kLine + kLine + kLine);
  const WatchedRun run = the_run("run");
  const json before = metrics_of_run(run);
  here.write("other.jsonl", kLine + kLine + kLine + kLine);
  fs::rename("other.jsonl", "run/metrics.jsonl");  // a run that is resumed, and has written more than it had
  const json after = metrics_of_run(run, before["next"], before["file"]);
  CHECK(after["restarted"]);
  CHECK(after["rows"].size() == 4);
  fs::resize_file("run/metrics.jsonl", kLine.size());
  const json shorter = metrics_of_run(run, after["next"], after["file"]);
  CHECK(shorter["restarted"]);
  CHECK(shorter["rows"].size() == 1);
}

TEST_CASE("lines that are none of a run are counted and left out") {
  const TemporaryFolder here;
  make_run(here, "run");
  const std::string rolled_back =
      R"({"stage": "refinement", "iteration": 3, "loss": null, "losses": {"fit": null}, "seconds": 1, "rolled_back": true})"
      "\n";
  here.write("run/metrics.jsonl",
             "{\"frame\": 1,\n\n[]\n{\"stage\": \"a\"}\n" + rolled_back + std::string(3, '\0') + "\n" + kLine);
  const json told = metrics_of_run(the_run("run"));
  CHECK(told["skipped"] == 5);
  CHECK(told["rows"] == json::array({json::parse(R"([null, "refinement", 3, null, 1.0, {"fit": null}])"), kRow}));
}

TEST_CASE("long metrics come in parts, and a line without an end does not stop them") {
  const TemporaryFolder here;
  make_run(here, "run");
  std::string text = std::string((std::size_t{1} << 20) + 7, 'x') + "\n";
  const std::size_t lines = 20000;
  for (std::size_t i = 0; i < lines; ++i) text += kLine;
  here.write("run/metrics.jsonl", text);
  const WatchedRun run = the_run("run");
  std::size_t rows = 0, parts = 0;
  json part = metrics_of_run(run);
  for (; part["next"] < part["size"] && ++parts < 10; part = metrics_of_run(run, part["next"], part["file"])) {
    CHECK_FALSE((part["restarted"].get<bool>()));
    rows += part["rows"].size();
  }
  CHECK(rows + part["rows"].size() == lines);
  CHECK(parts >= 2);
}

TEST_CASE("a run of the program is told as it is") {
  const TemporaryFolder here;
  execute_tiny(tiny_config({"stages.camera.iterations=2", "stages.interaction.iterations=3"}), "run");
  const json run = json::parse(watched_run_json(the_run("run")));
  CHECK(run["state"] == "done");
  CHECK(run["total"] == kTinyFrames - 1);
  CHECK(run["frames"].size() == kTinyFrames);
  CHECK(run["stages"] ==
        json::parse(R"([{"name": "camera", "iterations": 2}, {"name": "interaction", "iterations": 3}])"));
  CHECK(run["results"].size() > 5);
  CHECK(metrics_of_run(the_run("run"))["rows"].size() == (kTinyFrames - 1) * 5);
}

// ---- Answers ----

namespace {

ServedReply ask(const std::string& path, const std::map<std::string, std::string>& parameters = {},
                const std::string& host = "127.0.0.1:8417", const std::string& method = "GET") {
  return watch_answer("runs", {method, host, path, parameters});
}

}  // namespace

TEST_CASE("only requests to this machine by its name are answered, and only GET") {
  const TemporaryFolder here;
  make_run(here, "runs/a");
  for (const char* host : {"127.0.0.1:8417", "localhost:9000", "localhost"})
    CHECK(ask("/runs", {}, host).status == 200);
  for (const char* host : {"", "evil.example", "evil.example:8417", "127.0.0.1.evil.example:8417",
                           "localhost:80@evil.example", "127.0.0.2"})
    CHECK(ask("/runs", {}, host).status == 403);
  for (const char* method : {"POST", "PUT", "DELETE", "HEAD", "OPTIONS"})
    CHECK(ask("/runs", {}, "localhost", method).status == 405);
}

TEST_CASE("no path of a request leads to a file") {
  const TemporaryFolder here;
  make_run(here, "runs/a");
  make_run(here, "secret");
  here.write("runs/a/frames/0001_render.png", "PNG of a");
  here.write("secret/frames/0001_render.png", "secret");
  const auto image = [](const std::string& run, const std::string& frame, const std::string& kind) {
    return ask("/image", {{"run", run}, {"frame", frame}, {"kind", kind}});
  };
  CHECK(image("a", "1", "render").body == "PNG of a");
  CHECK(image("a", "1", "render").type == "image/png");
  CHECK(image("a", "1", "target").status == 404);
  for (const std::string& run :
       std::vector<std::string>{"../secret", "a/../../secret", "/etc", "", "A", (here.path() / "secret").string()}) {
    INFO(run);
    CHECK(image(run, "1", "render").status == 404);
    CHECK(ask("/run", {{"run", run}}).status == 404);
    CHECK(ask("/metrics", {{"run", run}, {"from", "0"}}).status == 404);
  }
  for (const std::string& frame : std::vector<std::string>{"", "-1", "1.5", "1 ", "99999999999", "../1"})
    CHECK(image("a", frame, "render").status == 400);
  for (const std::string& kind : std::vector<std::string>{"", "side", "../../status.json"})
    CHECK(image("a", "1", kind).status == 400);
  for (const std::string& from : std::vector<std::string>{"", "-1", "x", "1e3"})
    CHECK(ask("/metrics", {{"run", "a"}, {"from", from}}).status == 400);
  for (const std::string& path :
       std::vector<std::string>{"/../secret/status.json", "/a/status.json", "//", "/run/", "/etc/passwd"})
    CHECK(ask(path, {{"run", "a"}}).status == 404);
}

TEST_CASE("the page, its style and its script are told, and a damaged plan too") {
  const TemporaryFolder here;
  make_run(here, "runs/a");
  CHECK_THAT(ask("/").body, Contains("/watch.js"));
  CHECK_THAT(ask("/watch.css").body, Contains("prefers-color-scheme: dark"));
  CHECK(ask("/watch.js").type == "text/javascript");
  here.write("runs/b/sweep.json", "{");
  fs::create_directory("runs/b/configs");
  const ServedReply reply = ask("/runs");
  CHECK(reply.status == 500);
  CHECK_THAT(reply.body, Contains("runs/b/sweep.json"));
}

}  // namespace watched_test
