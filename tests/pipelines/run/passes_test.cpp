// Runs that go through the frames again after a stage over the sequence.
#include <algorithm>
#include <cmath>

#include <catch2/catch.hpp>

#include "body/avatar.h"
#include "body/motion_io.h"
#include "core/check.h"
#include "core/image_io.h"
#include "pipelines/config/run_problems.h"
#include "tests/support/event_records.h"
#include "tests/support/tiny_run.h"

namespace passes_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
using Catch::Matchers::Message;
namespace fs = std::filesystem;

namespace {

const std::vector<std::string> kNone;
constexpr int kLater = kTinyFrames - 1;                          // frames that are worked on
constexpr int kFirst = 6 * kLater, kSmooth = 5, kAgain = 2 + 3;  // iterations

/// The tiny dataset's stages, few iterations of them, a stage over the sequence, and both again.
RunConfig passes_config(const std::vector<std::string>& overrides = {}) {
  const TemporaryFolder here;
  nlohmann::ordered_json content = nlohmann::ordered_json::parse(R"({
    "log": {"tensorboard": true},
    "stages": {
      "camera": {"iterations": 2}, "interaction": {"iterations": 4},
      "refinement": {
        "over": "sequence", "iterations": 5, "optimize": {"transl": {"lr": 0.002}},
        "losses": {"fit": {}, "smooth": {"weight": 0.05}}
      },
      "camera_again": {
        "iterations": 2, "draw": "scene", "optimize": {"camera": {"lr": 0.001}}, "losses": {"masked_l2": {}}
      },
      "again": {
        "iterations": 3, "optimize": {"transl": {"lr": 0.005}, "object_transl": {"lr": 0.005}},
        "losses": {"photometric": {}, "smooth": {"weight": 0.001}, "center": {"weight": 0.001}}
      },
      "refinement_again": {
        "over": "sequence", "iterations": 5, "optimize": {"transl": {"lr": 0.002}},
        "losses": {"fit": {}, "smooth": {"weight": 0.05}}
      }
    }})");
  content["extends"] = tiny_config_file();
  here.write("passes.json", content.dump());
  return load_run_config("passes.json", overrides, descriptions_of(loss_terms()), ConfigUse::kStages);
}

/// The first `count` stages of a config.
RunConfig up_to(RunConfig config, std::size_t count) {
  config.stages.resize(count);
  return config;
}

void check_stopped_after(const RunConfig& config, int last, const std::string& message) {
  INFO("stopped after iteration " << last);
  const std::string run = "stopped" + std::to_string(last);
  int count = 0;
  CHECK_THROWS_MATCHES(execute_tiny(config, run, 1, false, [&] { return ++count == last; }), Interrupted,
                       Message(message));
  count = 0;
  execute_tiny(config, run, 2, true, [&] { return ++count < 0; });
  CHECK(differences("whole", run) == kNone);
  CHECK(events_of_run(run) == events_of_run("whole"));
}

}  // namespace

TEST_CASE("a stage over frames after one over the sequence goes through the frames again", "[run][passes]") {
  const TemporaryFolder here;
  const RunConfig config = passes_config();
  execute_tiny(config, "run");
  std::vector<std::pair<std::string, int>> order;  // stage and frame, as the lines have them
  for (const nlohmann::json& line : metrics_of("run")) {
    const std::pair<std::string, int> at = {line["stage"], line.value("frame", -1)};
    if (order.empty() || order.back() != at) order.push_back(at);
  }
  CHECK(order == std::vector<std::pair<std::string, int>>{{"camera", 1},
                                                          {"interaction", 1},
                                                          {"camera", 2},
                                                          {"interaction", 2},
                                                          {"camera", 3},
                                                          {"interaction", 3},
                                                          {"refinement", -1},
                                                          {"camera_again", 1},
                                                          {"again", 1},
                                                          {"camera_again", 2},
                                                          {"again", 2},
                                                          {"camera_again", 3},
                                                          {"again", 3},
                                                          {"refinement_again", -1}});
  const nlohmann::json summary = json_of("run/summary.json");
  double mean = 0;  // of the errors by frame that the first pass left
  for (const nlohmann::json& frame : summary["first_pass_per_frame"]) mean += frame["mpjpe_mm"].get<double>() / kLater;
  CHECK(mean == Approx(summary["metrics"][1]["mpjpe_mm"].get<double>()));
  CHECK(summary["first_pass_per_frame"] != summary["per_frame"]);
  REQUIRE(summary["metrics"].size() == 6);
  CHECK(summary["metrics"][4]["stage"] == "again");
  CHECK(summary["metrics"][4]["iterations"] == 3 * kLater);
  CHECK(summary["metrics"][4]["world_mpjpe_mm"] != summary["metrics"][2]["world_mpjpe_mm"]);
  CHECK_FALSE(summary["metrics"][3].contains("mpjpe_mm"));  // of the camera alone
  CHECK(summary["metrics"][5].contains("psnr_db"));
  CHECK_THAT(file_text("run/log.txt"), Contains("frame 2, stage again: 3 iterations in "));

  // Frame 0 stands, and what a pass does not move is as it was.
  execute_tiny(up_to(config, 3), "once");
  const Motion once = read_motion("once/motion.npz"), twice = read_motion("run/motion.npz");
  for (std::size_t t = 0; t < once.poses.size(); ++t) {
    CHECK((once.poses[t].transl == twice.poses[t].transl) == (t == 0));
    CHECK(once.poses[t].axis_angle == twice.poses[t].axis_angle);
  }
}

TEST_CASE("each frame of a later pass begins where the stages before left it", "[run][passes]") {
  const TemporaryFolder here;
  RunConfig config = up_to(passes_config({"stages.again.losses.smooth.weight=0", "stages.again.losses.center.weight=0",
                                          "stages.again.losses.photometric.ssim_share=0", "remove_depth_bias=true"}),
                           5);
  config.stages.erase(config.stages.begin() + 3);  // the camera
  execute_tiny(up_to(config, 3), "once");
  execute_tiny(config, "twice");
  for (auto& [name, group] : config.stages.back().second.optimize) group.lr = 0;
  execute_tiny(config, "still");
  // Without steps it ends there, but for the bias of depths, which is given back and taken again.
  const Motion once = read_motion("once/motion.npz"), still = read_motion("still/motion.npz");
  for (std::size_t t = 0; t < once.poses.size(); ++t)
    CHECK((once.poses[t].transl - still.poses[t].transl).norm() < 1e-5);
  // Without the bias of depths the first loss is the difference of the image that was there before.
  RunConfig unbiased = config;
  unbiased.remove_depth_bias = false;
  execute_tiny(up_to(unbiased, 3), "unbiased_once");
  execute_tiny(unbiased, "unbiased");
  int compared = 0;
  for (const nlohmann::json& line : metrics_of("unbiased")) {
    if (line["stage"] != "again" || line["iteration"] != 0) continue;
    const RunPaths paths{"unbiased_once"};
    const Image render = read_image(paths.frame_image(line["frame"], "render")),
                target = read_image(paths.frame_image(line["frame"], "target"));
    double sum = 0;
    for (int c = 0; c < 3; ++c) {
      for (int y = 0; y < kTinyPixels; ++y) {
        for (int x = 0; x < kTinyPixels; ++x) sum += std::fabs(render(c, y, x) - target(c, y, x));
      }
    }
    CHECK(line["loss"].get<double>() == Approx(sum / (3.0 * kTinyPixels * kTinyPixels)).margin(0.5 / 255));
    ++compared;
  }
  CHECK(compared == kLater);
}

TEST_CASE("a run with passes that was stopped anywhere and resumed has the bits of one that was not", "[run][passes]") {
  const TemporaryFolder here;
  const RunConfig config = passes_config();
  execute_tiny(config, "whole");
  check_stopped_after(config, kFirst + 2, "interrupted after the last frame; frames 1 to 3 are finished and kept");
  const std::string end = "; the frames before it and pass 1 are finished and kept";
  check_stopped_after(config, kFirst + kSmooth + 3, "interrupted in frame 1 of pass 2" + end);
  check_stopped_after(config, kFirst + kSmooth + kAgain + 1, "interrupted in frame 2 of pass 2" + end);
  check_stopped_after(config, kFirst + kSmooth + 2 * kAgain + 4, "interrupted in frame 3 of pass 2" + end);
  CHECK_THAT(file_text("stopped" + std::to_string(kFirst + kSmooth + kAgain + 1) + "/log.txt"),
             Contains("resumed with frame 2 of 3 of stage again\n"));
  check_stopped_after(config, kFirst + kSmooth + 3 * kAgain + 2,
                      "interrupted after the last frame; frames 1 to 3 are finished and kept");
}

TEST_CASE("a run with passes, a color net, the bias of depths and sigmas is resumed to the same bits",
          "[run][passes][color_net]") {
  const TemporaryFolder here;
  RunConfig config = passes_config({"remove_depth_bias=true", "uncertainty=true", "color_net.use=on",
                                    "color_net.features=4", "color_net.hidden_width=8"});
  ParameterGroupSettings net;
  net.lr = 0.05;
  for (auto& [name, stage] : config.stages) {
    if (name == "interaction" || name == "again") stage.optimize.emplace_back("color_net", net);
    if (name == "camera_again") stage.optimizer = {.kind = OptimizerKind::kBfgs, .keep_curvature = true};
  }
  execute_tiny(config, "whole");
  CHECK(file_text("whole/checkpoint/color_net_0001.safetensors") !=
        file_text("whole/checkpoint/color_net_0001_pass2.safetensors"));
  constexpr int kFit = 4;  // of frame 0
  int count = 0;
  for (const int last : {kFirst + 1, kFirst + kFit + kSmooth + kAgain, kFirst + kFit + kSmooth + 2 * kAgain + 4}) {
    INFO("stopped after iteration " << last);
    const std::string run = "stopped" + std::to_string(last);
    count = 0;
    CHECK_THROWS_AS(execute_tiny(config, run, 1, false, [&] { return ++count == last; }), Interrupted);
    execute_tiny(config, run, 2, true);
    CHECK(differences("whole", run) == kNone);
  }
  // Resumed when all is done, nothing is done again.
  count = 0;
  execute_tiny(config, "whole", 1, true, [&] { return ++count < 0; });
  CHECK(count < 2 * kSmooth + 4 * kTinyFrames);
}

TEST_CASE("a run with passes has the same bits for any number of threads", "[run][passes][parallel]") {
  const TemporaryFolder here;
  execute_tiny(passes_config(), "one", 1);
  execute_tiny(passes_config(), "two", 2);
  CHECK(differences("one", "two") == kNone);
}

TEST_CASE("passes.count makes the passes that stages written out make, to the same bits", "[run][passes]") {
  const TemporaryFolder here;
  RunConfig counted = up_to(passes_config(), 3);
  counted.passes = {.count = 2, .iterations_share = 0.75, .lr_share = 0.5};
  execute_tiny(counted, "counted");
  RunConfig written = up_to(passes_config(), 3);
  StageSettings again = written.stages[1].second;
  again.iterations = 3;
  for (auto& [name, group] : again.optimize) group.lr /= 2;
  written.stages.emplace_back("interaction_2", again);
  written.stages.emplace_back("refinement_2", written.stages[2].second);
  execute_tiny(written, "written");
  CHECK(differences("counted", "written") == kNone);
  CHECK(json_of("counted/summary.json")["metrics"].size() == 5);
  execute_tiny(counted, "counted", 1, true);  // what is resumed is the same run
}

TEST_CASE("in a later pass smooth sees the frames that follow", "[run][passes]") {
  const TemporaryFolder here;
  RunConfig config = up_to(passes_config({"stages.again.losses.smooth.order=2"}), 5);
  config.stages.erase(config.stages.begin() + 3);  // the camera
  execute_tiny(up_to(config, 3), "once");
  execute_tiny(config, "twice");
  const Clip clip = read_run_clip(config, loss_terms());
  std::vector<std::vector<double>> joints;
  for (const BodyPose& pose : read_motion("once/motion.npz").poses)
    joints.push_back(pose_skeleton(clip.avatar, pose).joints);
  // Of frame 1: of frames 0 to 2, and of 1 to 3, of which those after it are where the pass before left them.
  double sum = 0;
  for (std::size_t t = 0; t < 2; ++t) {
    for (std::size_t i = 0; i < 66; ++i) {
      const double d = joints[t + 2][i] - 2 * joints[t + 1][i] + joints[t][i];
      sum += d * d;
    }
  }
  int compared = 0;
  for (const nlohmann::json& line : metrics_of("twice")) {
    if (line["stage"] != "again" || line["iteration"] != 0 || line["frame"] != 1) continue;
    CHECK(line["losses"]["smooth"].get<double>() == Approx(sum / 2).epsilon(1e-3));
    ++compared;
  }
  CHECK(compared == 1);
}

TEST_CASE("fit by sigma is as sure as each pass is, tells nobody, and is resumed to the same bits", "[run][passes]") {
  const TemporaryFolder here;
  const std::vector<std::string> by_sigma = {"stages.refinement.losses.fit.by_sigma=true",
                                             "stages.refinement_again.losses.fit.by_sigma=true"};
  const RunConfig config = passes_config(by_sigma);
  execute_tiny(config, "whole");
  CHECK(read_joint_sigmas("whole/motion.npz").empty());
  CHECK_FALSE(json_of("whole/summary.json")["metrics"].back().contains("sigma_depth_mm"));
  execute_tiny(passes_config(), "plain");
  const auto places = [](const char* folder) { return read_motion(std::string(folder) + "/motion.npz").poses; };
  CHECK(places("whole")[1].transl != places("plain")[1].transl);
  check_stopped_after(config, kFirst + kSmooth + kAgain + 1,
                      "interrupted in frame 2 of pass 2; the frames before it and pass 1 are finished and kept");
  // A run that tells how sure it is has the same result.
  std::vector<std::string> telling = by_sigma;
  telling.emplace_back("uncertainty=true");
  execute_tiny(passes_config(telling), "telling");
  CHECK(places("telling")[1].transl == places("whole")[1].transl);
  CHECK(read_joint_sigmas("telling/motion.npz").size() == 44 * kTinyFrames);
}

TEST_CASE("of each pass the last stage that moves all by pixels tells how sure places are", "[passes]") {
  CHECK(stages_of_sigmas(passes_config()) == std::vector<std::size_t>{1, 4});
  RunConfig config = passes_config();
  config.stages.insert(config.stages.begin() + 1, config.stages[1]);  // two of them side by side
  CHECK(stages_of_sigmas(config) == std::vector<std::size_t>{2, 5});
  // The first pass has its own: its refinement alone weighs by them.
  const TemporaryFolder here;
  execute_tiny(up_to(passes_config(), 3), "plain");
  execute_tiny(up_to(passes_config({"stages.refinement.losses.fit.by_sigma=true"}), 3), "weighed");
  CHECK(read_motion("plain/motion.npz").poses[1].transl != read_motion("weighed/motion.npz").poses[1].transl);
}

TEST_CASE("fit by sigma is refused where no stage tells how sure places are", "[passes]") {
  const auto problem = [](const RunConfig& config) {
    const std::vector<RunProblem> problems = run_problems(config, ConfigUse::kStages);
    return problems.size() == 1 ? problems[0].pointer + ": " + problems[0].text : std::to_string(problems.size());
  };
  const RunConfig config = passes_config({"stages.refinement.losses.fit.by_sigma=true"});
  CHECK(run_problems(config, ConfigUse::kStages).empty());
  RunConfig before = config;
  std::erase_if(before.stages, [](const auto& stage) { return stage.first == "interaction"; });
  CHECK(problem(before) ==
        "/stages/refinement/losses/fit/by_sigma: no stage over frames before it moves human and objects and compares "
        "images or masks; allowed: false");
  RunConfig in_frame = config;
  in_frame.stages[1].second.losses.push_back(*std::find_if(in_frame.stages[2].second.losses.begin(),
                                                           in_frame.stages[2].second.losses.end(),
                                                           [](const auto& loss) { return loss.first == "fit"; }));
  CHECK(problem(in_frame) ==
        "/stages/interaction/losses/fit/by_sigma: a stage over the sequence alone knows how sure places are; allowed: "
        "false");
}

TEST_CASE("further passes are refused behind a stage over frames", "[passes]") {
  RunConfig config = passes_config();
  config.stages.pop_back();
  config.passes.count = 2;
  const std::vector<RunProblem> problems = run_problems(config, ConfigUse::kStages);
  REQUIRE(problems.size() == 1);
  CHECK(problems[0].pointer == "/passes/count");
  CHECK_THAT(problems[0].text, Contains("the last stage is over frames"));
}

TEST_CASE("the best start is one of the first pass", "[passes]") {
  RunConfig config = passes_config();
  config.start.objects = StartFrom::kBest;
  CHECK(run_problems(config, ConfigUse::kStages).empty());
  config.stages.erase(config.stages.begin() + 1);  // its only stage that draws everything
  const std::vector<RunProblem> problems = run_problems(config, ConfigUse::kStages);
  REQUIRE(problems.size() == 1);
  CHECK(problems[0].pointer == "/start/objects");
}

}  // namespace passes_test
