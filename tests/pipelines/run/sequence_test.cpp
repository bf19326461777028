// Runs that end with a stage over the whole sequence.
#include <algorithm>
#include <cmath>
#include <set>

#include <catch2/catch.hpp>

#include "body/motion_io.h"
#include "body/procedural_body.h"
#include "core/camera_file.h"
#include "core/check.h"
#include "core/image_io.h"
#include "pipelines/config/run_notes.h"
#include "pipelines/draw/frame_images.h"
#include "pipelines/graph/frame_graph.h"
#include "pipelines/input/state.h"
#include "tests/support/tiny_run.h"
#include "tests/support/vposer_checkpoint.h"

namespace sequence_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
using Catch::Matchers::Message;
namespace fs = std::filesystem;

namespace {

constexpr int kCameraIterations = 2, kInteractionIterations = 4, kRefinementIterations = 12;
constexpr int kInAFrame = kCameraIterations + kInteractionIterations;
constexpr int kInFrames = kInAFrame * (kTinyFrames - 1);
const std::vector<std::string> kNone;

/// The tiny dataset's stages, fewer iterations of them, and the refinement of configs/paper.json.
RunConfig refined_config(const std::vector<std::string>& overrides = {}) {
  const TemporaryFolder here;
  nlohmann::json content = nlohmann::json::parse(R"({"stages": {
    "camera": {"iterations": 2}, "interaction": {"iterations": 4},
    "refinement": {
      "over": "sequence", "iterations": 12,
      "optimize": {"transl": {"lr": 0.002}, "global_orient": {"lr": 0.002}, "pose_latents": {"lr": 0.01}},
      "losses": {"fit": {}, "contact": {"weight": 0.01}, "smooth": {"weight": 0.05}}
    }}})");
  content["extends"] = tiny_config_file();
  here.write("refined.json", content.dump());
  return load_run_config("refined.json", overrides, descriptions_of(loss_terms()));
}

/// The same without the stage over the sequence.
RunConfig frames_alone(RunConfig config) {
  config.stages.pop_back();
  return config;
}

const nlohmann::json& entry_of(const nlohmann::json& summary, const std::string& stage) {
  for (const nlohmann::json& entry : summary["metrics"]) {
    if (entry["stage"] == stage) return entry;
  }
  FAIL("the summary has no entry for " << stage);
  return summary;
}

/// What a run stopped after `last` iterations says.
std::string stop_message_at(int last) {
  const int frame = (last - 1) / kInAFrame + 1;
  if (frame >= kTinyFrames) return "interrupted after the last frame; frames 1 to 3 are finished and kept";
  const char* const kept = frame == 1   ? "no frame was finished"
                           : frame == 2 ? "frame 1 is finished and kept"
                                        : "frames 1 to 2 are finished and kept";
  return "interrupted in frame " + std::to_string(frame) + "; " + kept;
}

/// Frame t of a run's result.
SceneState state_in(const fs::path& run, std::size_t t) {
  SceneState state;
  state.camera_from_world = read_cameras((run / "cameras.json").string()).at(t).camera_from_world;
  state.objects = read_object_tracks((run / "objects.npz").string(), {kTinyObject}).at(t);
  state.body = read_motion((run / "motion.npz").string()).poses.at(t);
  return state;
}

Image drawn(const RunConfig& config, const Clip& clip, const SceneState& state, const ColorNet& net) {
  FrameGraphSettings settings;
  settings.render = config.render;
  settings.background = Vector3<double>(config.background.data());
  settings.color_nets = {&net, 1};
  Tape<float> tape;
  FrameGraph<float> graph(tape, clip, state.camera_from_world, settings);
  graph.set_state(state);
  tape.forward(graph.rendered().image);
  return to_image(tape.value(graph.rendered().image));
}

/// Mean difference of two images, the first one as it would be shown.
double mean_difference(const Image& rendered, const Image& written) {
  double sum = 0;
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < kTinyPixels; ++y) {
      for (int x = 0; x < kTinyPixels; ++x)
        sum += std::fabs(std::clamp(rendered(c, y, x), 0.0F, 1.0F) - written(c, y, x));
    }
  }
  return sum / (3.0 * kTinyPixels * kTinyPixels);
}

/// Stops a run after so many iterations, resumes it, and compares it with one that was not stopped.
void check_stopped_after(int last) {
  INFO("stopped after iteration " << last);
  const RunConfig config = refined_config();
  const TemporaryFolder here;
  execute_tiny(config, "whole");
  REQUIRE(result_of("whole").contains("body.glb"));
  int count = 0;
  CHECK_THROWS_MATCHES(execute_tiny(config, "run", 1, false, [&] { return ++count == last; }), Interrupted,
                       Message(stop_message_at(last)));
  CHECK(json_of("run/status.json")["state"] == "interrupted");
  CHECK(json_of("run/status.json")["message"] == stop_message_at(last));
  CHECK(metrics_of("run").size() == static_cast<std::size_t>(last));
  CHECK_FALSE(fs::exists("run/summary.json"));
  execute_tiny(config, "run", 2, true);
  CHECK(differences("whole", "run") == kNone);
  std::set<std::string> seen;  // no line is there twice
  for (const nlohmann::json& line : metrics_of("run")) {
    const std::string frame = line.contains("frame") ? line["frame"].dump() : "all";
    CHECK(seen.insert(frame + line["stage"].dump() + line["iteration"].dump()).second);
  }
}

}  // namespace

TEST_CASE("a run with a stage over the sequence tells of it as of the others", "[run][sequence]") {
  const TemporaryFolder here;
  const RunConfig config = refined_config();
  execute_tiny(frames_alone(config), "frames");
  const RunSummary summary = execute_tiny(config, "run");

  const std::vector<nlohmann::json> lines = metrics_of("run");
  REQUIRE(lines.size() == kInFrames + kRefinementIterations);
  for (int i = 0; i < kRefinementIterations; ++i) {
    const nlohmann::json& line = lines[static_cast<std::size_t>(kInFrames + i)];
    INFO(line.dump());
    CHECK(line["stage"] == "refinement");
    CHECK_FALSE(line.contains("frame"));
    CHECK(line["iteration"] == i);
    CHECK(std::isfinite(line["loss"].get<double>()));
    CHECK(line["losses"].size() == 3);
    CHECK_FALSE(line.contains("tiles"));  // nothing is drawn
  }
  for (int i = 0; i < kInFrames; ++i) CHECK(lines[static_cast<std::size_t>(i)].contains("frame"));
  CHECK(lines.back()["loss"].get<double>() < lines[kInFrames]["loss"].get<double>());

  const nlohmann::json written = json_of("run/summary.json"), before = json_of("frames/summary.json");
  REQUIRE(written["metrics"].size() == 3);
  CHECK(written["metrics"].back()["stage"] == "refinement");
  const nlohmann::json &refinement = entry_of(written, "refinement"), &interaction = entry_of(written, "interaction");
  CHECK(refinement["iterations"] == kRefinementIterations);
  for (const char* name : {"psnr_db", "psnr_foreground_db", "ssim"}) {
    INFO(name);
    CHECK(refinement[name].get<double>() > 0);
    CHECK(interaction[name] == entry_of(before, "interaction")[name]);  // of the images before the refinement
    CHECK(interaction[name] != refinement[name]);
    CHECK_FALSE(entry_of(written, "camera").contains(name));
    double sum = 0;
    for (const nlohmann::json& frame : written["per_frame"]) sum += frame[name].get<double>();
    CHECK(sum / (kTinyFrames - 1) == Approx(refinement[name].get<double>()).epsilon(1e-12));
  }
  CHECK(interaction["mpjpe_mm"] == entry_of(before, "interaction")["mpjpe_mm"]);
  CHECK(refinement["mpjpe_mm"] != interaction["mpjpe_mm"]);
  CHECK(summary.metrics.back().stage == "refinement");

  // The body has moved in the frames that are not given; objects and cameras stand.
  const Motion refined = read_motion("run/motion.npz"), plain = read_motion("frames/motion.npz");
  for (std::size_t t = 0; t < kTinyFrames; ++t) {
    INFO("frame " << t);
    CHECK((refined.poses[t].transl == plain.poses[t].transl) == (t == 0));
    CHECK((refined.poses[t].axis_angle == plain.poses[t].axis_angle) == (t == 0));
  }
  CHECK(file_text("run/objects.npz") == file_text("frames/objects.npz"));
  CHECK(file_text("run/cameras.json") == file_text("frames/cameras.json"));
  for (const char* same : {"0001_target.png", "0001_start.png"})
    CHECK(file_text(fs::path("run/frames") / same) == file_text(fs::path("frames/frames") / same));
  CHECK(file_text("run/frames/0003_render.png") != file_text("frames/frames/0003_render.png"));
}

TEST_CASE(
    "a run with a stage over the sequence that was stopped in a frame and resumed has the bits of one that was not",
    "[run][sequence]") {
  for (const int last : {kInAFrame + 3, kInFrames})
    check_stopped_after(last);  // within a frame, at the end of the last
}

TEST_CASE("a run that was stopped in a stage over the sequence and resumed has the bits of one that was not",
          "[run][sequence]") {
  for (const int last : {kInFrames + 1, kInFrames + kRefinementIterations}) check_stopped_after(last);
}

TEST_CASE("a run with a stage over the sequence has the same bits for any number of threads, in double too",
          "[run][sequence][parallel]") {
  const TemporaryFolder here;
  for (const std::string precision : {"float", "double"}) {
    const RunConfig config = refined_config({"precision=" + precision});
    execute_tiny(config, precision + "1", 1);
    execute_tiny(config, precision + "2", 2);
    CHECK(differences(precision + "1", precision + "2") == kNone);
  }
  CHECK(file_text("float1/motion.npz") != file_text("double1/motion.npz"));
}

TEST_CASE("images after a stage over the sequence have each frame's own color net", "[run][sequence][color_net]") {
  const TemporaryFolder here;
  RunConfig config = refined_config({"color_net.use=on", "color_net.features=4", "color_net.hidden_width=8"});
  ParameterGroupSettings moved;
  moved.lr = 0.1;
  for (auto& [name, stage] : config.stages) {
    if (name == "interaction") stage.optimize.emplace_back("color_net", moved);
  }
  execute_tiny(config, "run");
  const Clip clip = read_clip(config.data);
  std::vector<ColorNet> nets;
  for (int t = 1; t < kTinyFrames; ++t)
    nets.push_back(read_color_net(RunPaths{"run"}.frame_color_net(t), clip.avatar.count(), clip.avatar.joint_count()));
  CHECK(nets.back() == read_color_net("run/color_net.safetensors", clip.avatar.count(), clip.avatar.joint_count()));
  for (int t = 1; t < kTinyFrames; ++t) {
    const Image written = read_image(RunPaths{"run"}.frame_image(t, "render"));
    const SceneState state = state_in("run", static_cast<std::size_t>(t));
    for (int of = 1; of < kTinyFrames; ++of) {
      const double difference =
          mean_difference(drawn(config, clip, state, nets[static_cast<std::size_t>(of - 1)]), written);
      INFO("frame " << t << " with the network after frame " << of << ": " << difference);
      if (of == t) CHECK(difference < 0.3 / 255);  // of 8 bits: 0.25 / 255
      if (of != t) CHECK(difference > 0.4 / 255);
    }
  }
  // Stopped and resumed within the stage, with the networks of the frames from their files.
  int count = 0;
  CHECK_THROWS_AS(execute_tiny(config, "again", 1, false, [&] { return ++count == kInFrames + 3; }), Interrupted);
  execute_tiny(config, "again", 2, true);
  CHECK(differences("run", "again") == kNone);
}

TEST_CASE("contact draws vertices of the body that the avatar was made on, else Gaussians, which is told",
          "[run][sequence]") {
  const Clip clip = read_run_clip(refined_config(), loss_terms());
  REQUIRE(clip.body.has_value());
  CHECK(clip.body->vertex_count() == procedural_body().vertex_count());
  CHECK_FALSE(read_run_clip(refined_config({"stages.refinement.losses.contact.points=gaussians"}), loss_terms()).body);
  CHECK_FALSE(read_run_clip(refined_config({"stages.refinement.losses.contact.weight=0"}), loss_terms()).body);
  const TemporaryFolder here;
  const RunConfig taller = refined_config({"body.shape=[3]"});
  CHECK_FALSE(read_run_clip(taller, loss_terms()).body);
  execute_tiny(taller, "taller");
  CHECK_THAT(file_text("taller/log.txt"),
             Contains("/stages/refinement/losses/contact: the avatar's Gaussians stand for the vertices of `body`: "
                      "joints of the avatar are "));
}

TEST_CASE("a stage over the sequence that leaves the body where it was is told", "[run][sequence]") {
  const TemporaryFolder here;
  execute_tiny(
      refined_config({"stages.refinement.optimize.transl.lr=1e-7", "stages.refinement.optimize.global_orient.lr=0",
                      "stages.refinement.optimize.pose_latents.lr=0"}),
      "still");
  execute_tiny(refined_config(), "moved");
  CHECK_THAT(file_text("still/log.txt"), Contains("stage refinement: the joints have moved by 0.00"));
  CHECK_THAT(file_text("moved/log.txt"), !Contains("the joints have moved by"));
}

TEST_CASE("a stage over the sequence that no prior holds is noted once, and not warned of", "[run][sequence]") {
  const auto notes = [](const RunConfig& config) {
    std::string text;
    for (const RunNote& note : run_notes(config)) text += note.text + "\n";
    return text;
  };
  const std::string told =
      "stages.refinement: without pose_weights its pose_latents stand for poses one to one, and no prior holds "
      "the body\n";
  CHECK(notes(refined_config()) == told);
  CHECK(notes(refined_config({"stages.refinement.optimize.pose_latents.lr=0"})).empty());
  CHECK(notes(refined_config({"stages.refinement.optimize.pose_latents=null"})).empty());
  CHECK(notes(refined_config(
                  {std::string("stages.refinement.pose_weights=") + HSI4D_SOURCE_DIR + "/configs/pose_prior.npz"}))
            .empty());
  CHECK(notes(frames_alone(refined_config())).empty());
  for (const char* shipped : {"best.json", "paper.json", "paper_static.json", "from_video.json"}) {
    INFO(shipped);
    const std::string of_shipped =
        notes(load_run_config(fs::path(HSI4D_SOURCE_DIR) / "configs" / shipped, {}, descriptions_of(loss_terms())));
    CHECK_THAT(of_shipped, Contains(told));
  }
  const TemporaryFolder here;
  execute_tiny(refined_config(), "run");
  const std::string log = file_text("run/log.txt");
  const std::size_t first = log.find(told);
  CHECK(first != std::string::npos);
  CHECK(log.find("no prior holds", first + told.size()) == std::string::npos);
}

TEST_CASE("a run whose stage over the sequence has VPoser's weights moves in its latents", "[run][sequence]") {
  const TemporaryFolder here;
  const Bytes bytes = random_vposer(48, 32, 11).npz();
  here.write("vposer.npz", std::string(bytes.begin(), bytes.end()));
  const std::string weights = "stages.refinement.pose_weights=" + fs::absolute("vposer.npz").string();
  const RunConfig config = refined_config({weights, "stages.refinement.iterations=3"});
  const RunSummary summary = execute_tiny(config, "vposer"), natural = execute_tiny(refined_config(), "natural");
  const double joints = number_in(summary.metrics.back().values, "mpjpe_mm");
  CHECK(std::isfinite(joints));
  CHECK(joints > number_in(natural.metrics.back().values, "mpjpe_mm") + 20);  // random weights have poses of their own
  CHECK(number_in(summary.metrics[1].values, "mpjpe_mm") == number_in(natural.metrics[1].values, "mpjpe_mm"));
  CHECK(metrics_of("vposer").size() == kInFrames + 3);
  execute_tiny(config, "again", 2);
  CHECK(differences("vposer", "again") == kNone);
}

}  // namespace sequence_test
