#include <csignal>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/npz.h"
#include "core/simd.h"
#include "optim/checkpoint.h"
#include "pipelines/cli/interrupt.h"
#include "tests/support/program.h"
#include "tests/support/running_program.h"
#include "tests/support/tiny_run.h"

namespace resume_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
namespace fs = std::filesystem;

namespace {

/// True when metrics.jsonl has a line of this frame.
bool has_reached(const std::string& run, int frame) {
  return file_text(run + "/metrics.jsonl").find("{\"frame\": " + std::to_string(frame) + ",") != std::string::npos;
}

/// Runs the program into `folder` and sends it the signal in this frame; tries again where it was too quick for that.
int run_and_signal(const std::vector<std::string>& arguments, const std::string& run, int signal, int frame) {
  for (int attempt = 0; attempt < 20; ++attempt) {
    RunningProgram program(arguments);
    if (program.signal_at(signal, [&] { return has_reached(run, frame); })) {
      INFO(program.text());
      return program.result();
    }
    fs::remove_all(run);
  }
  return 0;
}

std::vector<std::string> run_arguments(const std::string& out) {
  return {"run", tiny_config_file(), "--out", out, "--threads", "1"};
}

std::vector<std::string> with_resume(std::vector<std::string> arguments) {
  arguments.push_back("--resume");
  return arguments;
}

std::string state_of(const std::string& run) { return json_of(run + "/status.json")["state"]; }

const std::vector<std::string> kNone;

}  // namespace

TEST_CASE("a run that was stopped anywhere and resumed has the bits of one that never was", "[run]") {
  const TemporaryFolder here;
  const RunConfig config = tiny_config();
  execute_tiny(config, "whole");
  // The iterations after which it is stopped: the very first one; within the first frame; the last one before a
  // checkpoint; the first one after it; in the last frame.
  for (const int last : {1, 10, kPerFrame, kPerFrame + 1, 2 * kPerFrame + 11}) {
    INFO("stopped after iteration " << last);
    const std::string run = "stopped" + std::to_string(last);
    int count = 0;
    const auto stop = [&] { return ++count == last; };
    const int frame = (last - 1) / kPerFrame + 1;
    CHECK_THROWS_MATCHES(execute_tiny(config, run, 1, false, stop), Interrupted,
                         Catch::Matchers::Message("interrupted in frame " + std::to_string(frame) + "; " +
                                                  (frame == 1   ? "no frame was finished"
                                                   : frame == 2 ? "frame 1 is finished and kept"
                                                                : "frames 1 to 2 are finished and kept")));
    CHECK(count == last);
    CHECK(state_of(run) == "interrupted");
    CHECK(metrics_of(run).size() == static_cast<std::size_t>(last));
    CHECK(fs::exists(run + "/checkpoint/progress.npz") == (frame > 1));
    CHECK_FALSE(fs::exists(run + "/summary.json"));
    CHECK_FALSE(fs::exists(run + "/motion.npz"));
    count = 0;
    execute_tiny(config, run, 2, true, [&] { return ++count < 0; });
    // No frame that was done is done again; two images of each are drawn for the preview.
    CHECK(count == (kTinyFrames - frame) * kPerFrame + 2 * kTinyFrames);
    CHECK(state_of(run) == "done");
    CHECK(json_of(run + "/status.json").contains("resumed"));
    CHECK(differences("whole", run) == kNone);
  }
}

TEST_CASE("a run with approximations that was stopped and resumed has the bits of one that never was", "[run]") {
  const TemporaryFolder here;
  RunConfig config = tiny_config();
  config.color_net.use = ColorNetUse::kOn;
  ParameterGroupSettings net;
  net.lr = 1e-3;
  net.every = 4;
  config.stages.back().second.optimize.emplace_back("color_net", net);
  config.approx.longest_side_px = kTinyPixels / 2;
  config.approx.hold_colors = true;
  config.approx.seen_within_deg = 10;
  StageSettings& camera = config.stages.front().second;
  REQUIRE(find_entry(camera.optimize, "camera") != nullptr);
  camera.optimizer.kind = OptimizerKind::kBfgs;
  camera.optimizer.keep_curvature = true;
  execute_tiny(config, "whole");
  for (const int last : {kPerFrame + 3, 2 * kPerFrame + 11}) {
    INFO("stopped after iteration " << last);
    const std::string run = "stopped" + std::to_string(last);
    int count = 0;
    CHECK_THROWS_AS(execute_tiny(config, run, 1, false, [&] { return ++count == last; }), Interrupted);
    execute_tiny(config, run, 2, true);
    CHECK(differences("whole", run) == kNone);
  }
}

TEST_CASE("a run whose stages have matrices that was stopped and resumed has the bits of one that never was", "[run]") {
  const TemporaryFolder here;
  RunConfig config = tiny_config();
  StageSettings& camera = config.stages.front().second;
  camera.optimizer.kind = OptimizerKind::kWhitenedAdam;
  camera.optimizer.keep_curvature = true;
  camera.optimizer.matrix_every = 3;
  StageSettings& interaction = config.stages.back().second;
  interaction.optimizer.kind = OptimizerKind::kLm;
  interaction.optimizer.matrix_tiles = 2;
  execute_tiny(config, "whole");
  int count = 0;
  const int last = 2 * kPerFrame;  // or the end of a stage that is done before
  CHECK_THROWS_AS(execute_tiny(config, "stopped", 1, false, [&] { return ++count == last; }), Interrupted);
  execute_tiny(config, "stopped", 2, true);
  CHECK(differences("whole", "stopped") == kNone);
}

TEST_CASE("a run resumed with another instruction set says that the bits will differ", "[run]") {
  const TemporaryFolder here;
  const RunConfig config = tiny_config();
  const std::string checkpoint = "run/checkpoint/progress.npz", now = isa_name(best_isa());
  int count = 0;
  CHECK_THROWS_AS(execute_tiny(config, "run", 1, false, [&] { return ++count == kPerFrame + 3; }), Interrupted);
  const std::string hash = Npz::read(checkpoint).array("config_hash").text();
  Checkpoint other = load_checkpoint(checkpoint, hash);
  CHECK(other.text("instruction_set") == now);
  fs::copy("run", "same", fs::copy_options::recursive);
  other.set("instruction_set", std::string("sse9"));
  other.save(checkpoint, hash);
  execute_tiny(config, "run", 1, true);
  execute_tiny(config, "same", 1, true);
  CHECK(state_of("run") == "done");
  CHECK(differences("same", "run") == kNone);  // the processor is the same after all
  CHECK(load_checkpoint(checkpoint, hash).text("instruction_set") == now);
  const std::string told = "resumed with instruction set " + now +
                           ", the frames so far were made with sse9: the bits will differ from those of a run that "
                           "was never stopped\n";
  const std::string log = file_text("run/log.txt");
  CHECK_THAT(log, Contains(told));
  CHECK(log.find("instruction set") == log.rfind("instruction set"));
  CHECK_THAT(file_text("same/log.txt"), !Contains("instruction set"));
}

TEST_CASE("a run can be stopped and resumed again and again", "[run]") {
  const TemporaryFolder here;
  const RunConfig config = tiny_config();
  execute_tiny(config, "whole");
  bool is_done = false;
  int rounds = 0;
  while (!is_done && rounds < 10) {
    int count = 0;
    try {  // a frame and a bit more each time
      execute_tiny(config, "run", 1, true, [&] { return ++count == kPerFrame + 3; });
      is_done = true;
    } catch (const Interrupted&) {
    }
    ++rounds;
  }
  CHECK(rounds == kTinyFrames);  // the preview is stopped too, once
  CHECK(differences("whole", "run") == kNone);
  execute_tiny(config, "run", 1, true);  // a run that is done: nothing changes
  CHECK(differences("whole", "run") == kNone);
}

TEST_CASE("a run that was killed and resumed has the bits of one that never was", "[run]") {
  const TemporaryFolder here;
  execute_tiny(tiny_config(), "whole");
  for (const int frame : {1, 2}) {  // before the first checkpoint, and after it
    INFO("killed in frame " << frame);
    const std::string run = "killed" + std::to_string(frame);
    REQUIRE(run_and_signal(run_arguments(run), run, SIGKILL, frame) == -SIGKILL);
    CHECK(state_of(run) == "running");
    const ProgramResult refused = run_hsi4d(run_arguments(run));
    CHECK(refused.status == 2);
    CHECK(refused.err == run +
                             ": holds a run that is not finished (running); choose another folder, remove this one, "
                             "or go on with it by --resume\n");
    const ProgramResult resumed = run_hsi4d(with_resume(run_arguments(run)));
    INFO(resumed.err);
    CHECK(resumed.status == 0);
    CHECK(state_of(run) == "done");
    CHECK(differences("whole", run) == kNone);
  }
}

TEST_CASE("lines that a kill cut short are written again", "[run]") {
  const TemporaryFolder here;
  const RunConfig config = tiny_config();
  execute_tiny(config, "whole");
  int count = 0;
  CHECK_THROWS_AS(execute_tiny(config, "run", 1, false, [&] { return ++count == kPerFrame + 5; }), Interrupted);
  fs::resize_file("run/metrics.jsonl", fs::file_size("run/metrics.jsonl") - 7);
  std::ofstream("run/frames/0002_render.png") << "half a file";
  std::ofstream("run/status.json") << "{\"state\": \"runn";
  for (const char* left :
       {"frames/0002_render.png.77-3.tmp", "checkpoint/progress.npz.77-4.tmp", "summary.json.77-5.tmp"})
    here.write(std::string("run/") + left, "half a file");
  execute_tiny(config, "run", 1, true);
  CHECK(differences("whole", "run") == kNone);
  CHECK(state_of("run") == "done");
  CHECK(temporaries_in("run") == kNone);
}

TEST_CASE("a signal is noted once, and not at all where it is ignored", "[run]") {
  const auto before = ::signal(SIGINT, SIG_IGN);
  {
    const cli::InterruptWatch watch;
    ::raise(SIGINT);
    CHECK_FALSE(cli::InterruptWatch::requested());
    ::raise(SIGTERM);
    CHECK(cli::InterruptWatch::requested());
    CHECK(::signal(SIGTERM, SIG_DFL) == SIG_DFL);  // the second one ends the program
  }
  CHECK(::signal(SIGINT, SIG_DFL) == SIG_IGN);
  {
    const cli::InterruptWatch watch;
    CHECK_FALSE(cli::InterruptWatch::requested());  // forgotten
    ::raise(SIGINT);
    CHECK(cli::InterruptWatch::requested());
  }
  CHECK(::signal(SIGINT, before) == SIG_DFL);
}

TEST_CASE("SIGINT ends a run in good order", "[run]") {
  const TemporaryFolder here;
  execute_tiny(tiny_config(), "whole");
  for (const int signal : {SIGINT, SIGTERM}) {
    INFO("signal " << signal);
    const std::string run = "run" + std::to_string(signal);
    REQUIRE(run_and_signal(run_arguments(run), run, signal, 2) == 130);
    CHECK(state_of(run) == "interrupted");
    const std::string message = json_of(run + "/status.json")["message"];
    CHECK_THAT(message, Catch::Matchers::Matches("interrupted in frame [23]; frames? 1 .*finished and kept"));
    const std::string said = file_text("running.txt");
    const std::string last_line = "hsi4d: " + message + "; the same command with --out " + run + " --resume goes on\n";
    INFO(said);
    CHECK(said.ends_with(last_line));
    CHECK(said.find(last_line) == said.size() - last_line.size());  // once
    CHECK_THAT(file_text(run + "/log.txt"), Contains("interrupted: " + message + "\n"));
    const ProgramResult resumed = run_hsi4d(with_resume(run_arguments(run)));
    INFO(resumed.err);
    CHECK(resumed.status == 0);
    CHECK(differences("whole", run) == kNone);
  }
}

TEST_CASE("a run that fails in the middle goes on once the cause is gone", "[run]") {
  const TemporaryFolder here;
  const fs::path data = fs::absolute("data");
  fs::copy(TinyDataset::folder(), data, fs::copy_options::recursive);
  const RunConfig config = load_run_config(data / "config.json", {}, descriptions_of(loss_terms()));
  execute_tiny(config, "whole");
  const std::string frame = (data / "frames" / "0002.png").string(), bytes = file_text(frame);
  const auto damage = [&] {  // after it was found to be sound
    std::ofstream(frame) << "no image";
    return false;
  };
  CHECK_THROWS_AS(execute_tiny(config, "run", 1, false, damage), DataError);
  const std::string message = json_of("run/status.json")["message"];
  CHECK(state_of("run") == "failed");
  CHECK_THAT(message, Contains(frame));
  CHECK_THAT(file_text("run/log.txt"), Contains("failed: " + message + "\n"));
  for (const char* name : {"summary.json", "motion.npz", "objects.npz", "cameras.json", "report.html"}) {
    INFO(name);
    CHECK_FALSE(fs::exists(fs::path("run") / name));
  }
  CHECK(metrics_of("run").size() == kPerFrame);
  std::ofstream(frame, std::ios::binary) << bytes;
  execute_tiny(config, "run", 1, true);
  CHECK(differences("whole", "run") == kNone);
}

TEST_CASE("a demo that was killed and resumed has the bits of one that never was", "[run][demo][full]") {
  const TemporaryFolder here;
  const auto arguments = [](const std::string& out) {
    std::vector<std::string> words = {"demo", "--quick", "--quiet", "--threads", "1", "--out", out};
    for (const char* setting : {"synthetic.frames=5", "synthetic.size_px=48", "synthetic.scene_gaussians=1500",
                                "synthetic.avatar_gaussians=500", "synthetic.object_gaussians=150",
                                "stages.camera.iterations=5", "stages.interaction.iterations=10"}) {
      words.insert(words.end(), {"--set", setting});
    }
    return words;
  };
  const ProgramResult whole = run_hsi4d(arguments("whole"));
  INFO(whole.err);
  REQUIRE(whole.status == 0);
  CHECK(whole.err.empty());
  CHECK_THAT(whole.out, Contains("5 frames in ") && Contains("; report: whole/run/report.html\n"));
  CHECK(fs::exists("whole/dataset/truth/motion.npz"));

  const ProgramResult refused = run_hsi4d(arguments("whole"));
  CHECK(refused.status == 2);
  CHECK(refused.err == "whole: holds a demo already; --resume goes on with it, another --out makes a new one\n");

  // The configs differ in nothing but the folder of their data, so the first demo is moved away to be compared with.
  fs::rename("whole", "before");
  REQUIRE(run_and_signal(with_resume(arguments("whole")), "whole/run", SIGKILL, 2) == -SIGKILL);
  const ProgramResult resumed = run_hsi4d(with_resume(arguments("whole")));
  INFO(resumed.err);
  CHECK(resumed.status == 0);
  CHECK(differences("before/run", "whole/run") == kNone);

  std::vector<std::string> other = with_resume(arguments("whole"));
  other.insert(other.end(), {"--set", "synthetic.seed=3"});
  CHECK(run_hsi4d(other).err ==
        "whole/dataset/synthetic.json: the dataset was made with other settings than these; "
        "make a new one in another folder\n");

  const ProgramResult nowhere = run_hsi4d({"demo", "--quick", "--resume"});
  CHECK(nowhere.status == 2);
  CHECK(nowhere.err == "hsi4d demo: --resume needs --out, to know with what\n");
  const ProgramResult wrong = run_hsi4d(
      {"demo", "--quick", "--out", "wrong", "--set", "stages.camera.draw=scene", "--set", "synthetic.frames=0"});
  CHECK(wrong.status == 2);
  CHECK_FALSE(fs::exists("wrong"));
}

}  // namespace resume_test
