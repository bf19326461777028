// Runs that look for frame 0 themselves, from a state of it that is not exact.
#include <catch2/catch.hpp>

#include "body/motion_io.h"
#include "core/camera_file.h"
#include "core/rotation.h"
#include "core/safetensors.h"
#include "pipelines/config/run_problems.h"
#include "pipelines/input/state.h"
#include "pipelines/metrics/penetration.h"
#include "tests/support/tiny_run.h"

namespace first_frame_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Message;
namespace fs = std::filesystem;

namespace {

constexpr int kCameraIterations = 100, kBodyIterations = 200;
constexpr int kFirstIterations = kCameraIterations + kBodyIterations;
const std::vector<std::string> kNone;

/// Stages over the first frame after those of the tiny dataset: a file can only append.
const char* const kFirstStages = R"({"stages": {
  "fit_first_camera": {
    "over": "first_frame", "iterations": 100, "draw": "scene", "weight": "unoccluded",
    "optimize": {"camera": {"lr": 0.004, "lr_final_share": 0.05}},
    "losses": {"masked_l2": {}}
  },
  "fit_first_frame": {
    "over": "first_frame", "iterations": 200,
    "optimize": {
      "transl": {"lr": 0.01, "lr_final_share": 0.05},
      "global_orient": {"lr": 0.01, "lr_final_share": 0.05},
      "body_pose": {"lr": 0.01, "lr_final_share": 0.05},
      "object_orient": {"lr": 0.01, "lr_final_share": 0.05},
      "object_transl": {"lr": 0.01, "lr_final_share": 0.05}
    },
    "losses": {"photometric": {"ssim_share": 0.1}, "mask": {}, "pose_prior": {}}
  }}})";

/// The config of a dataset with these stages before its own.
RunConfig config_with_first_stages(const fs::path& dataset, const std::vector<std::string>& overrides = {}) {
  nlohmann::json content = nlohmann::json::parse(kFirstStages);
  content["extends"] = (dataset / "config.json").string();
  const TemporaryFolder here;
  here.write("first.json", content.dump());
  return load_run_config("first.json", overrides, descriptions_of(loss_terms()));
}

/// Frame 0 is given some centimetres and degrees beside the truth.
void disturb(const fs::path& path) {
  Motion motion = read_motion((path / "initial_motion.npz").string());
  BodyPose& first = motion.poses.front();
  first.transl += Vector3<double>(0.03, 0.02, -0.02);
  first.set_rotation(
      0, so3_log(Matrix3<double>(so3_exp(Vector3<double>(0.02, -0.04, 0.05)) * so3_exp(first.rotation_of(0)))));
  for (const Index joint : {1, 2, 16, 17, 18, 19})  // hips, shoulders, elbows
    first.set_rotation(joint, first.rotation_of(joint) + Vector3<double>(0.05, -0.06, 0.05));
  write_motion((path / "initial_motion.npz").string(), motion);
  write_changed(path / "initial.json", path / "initial.json", [](nlohmann::ordered_json& initial) {
    nlohmann::ordered_json& object = initial["objects"][kTinyObject];
    object["translation"][0] = object["translation"][0].get<double>() + 0.03;
    object["translation"][2] = object["translation"][2].get<double>() - 0.02;
    object["rotation"][2] = object["rotation"][2].get<double>() + 0.1;
  });
  Camera camera = read_camera((path / "camera.json").string());
  camera.camera_from_world.translation += Vector3<double>(0.02, -0.01, 0.015);
  write_camera((path / "camera.json").string(), camera);
}

/// The tiny dataset, disturbed.
struct DisturbedDataset : CopiedDataset {
  DisturbedDataset() { disturb(path); }
};

/// Two frames that show enough to find centimetres by.
fs::path disturbed_dataset_of_two_frames() {
  SyntheticSettings settings = TinyDataset::settings();
  settings.frames = 2;
  settings.size_px = 128;
  settings.scene_gaussians = 4000;
  settings.avatar_gaussians = 1500;
  ConfigProblems problems;
  const ConfigValue stages = load_config_text(kTinyStages, "tiny.json", fs::current_path(), {}, problems);
  write_dataset(settings, video_render_settings(), "data", {}, stages);
  disturb("data");
  return fs::absolute("data");
}

SceneState first_state_of(const fs::path& run) {
  SceneState state;
  state.camera_from_world = read_cameras((run / "cameras.json").string()).front().camera_from_world;
  state.objects = read_object_tracks((run / "objects.npz").string(), {kTinyObject}).front();
  state.body = read_motion((run / "motion.npz").string()).poses.front();
  return state;
}

bool same(const SceneState& a, const SceneState& b) {
  return a.camera_from_world.rotation == b.camera_from_world.rotation &&
         a.camera_from_world.translation == b.camera_from_world.translation && a.body.transl == b.body.transl &&
         a.body.axis_angle == b.body.axis_angle && a.objects[0].rotation == b.objects[0].rotation &&
         a.objects[0].translation == b.objects[0].translation;
}

const Baseline& baseline_of(const RunSummary& summary, const std::string& name) {
  for (const Baseline& baseline : summary.baselines) {
    if (baseline.name == name) return baseline;
  }
  FAIL("there is no baseline " << name);
  return summary.baselines.front();
}

}  // namespace

TEST_CASE("stages over the first frame find what was given some centimetres beside it", "[run][first_frame][release]") {
  const TemporaryFolder here;
  const fs::path dataset = disturbed_dataset_of_two_frames();
  const RunConfig config = config_with_first_stages(dataset);
  REQUIRE(config.stages.size() == 4);
  CHECK(config.stages.front().first == "fit_first_camera");  // whatever was written first
  const RunSummary summary = execute_tiny(config, "run");

  const MetricValues& given = baseline_of(summary, "given_frame_0").values;
  REQUIRE(summary.metrics.size() == 4);
  const MetricValues &camera = summary.metrics[0].values, &found = summary.metrics[1].values;
  for (std::size_t s = 0; s < 4; ++s) CHECK(summary.metrics[s].of_frame_0 == (s < 2));
  for (const char* name : {"mpjpe_mm", "world_mpjpe_mm", "root_translation_mm", "object_translation_cm",
                           "object_rotation_deg", "camera_translation_cm"}) {
    UNSCOPED_INFO(name << ": " << number_in(given, name) << " -> " << number_in(found, name));
  }
  CHECK(number_in(camera, "camera_translation_cm") < 0.3 * number_in(given, "camera_translation_cm"));
  CHECK(number_in(found, "camera_translation_cm") == number_in(camera, "camera_translation_cm"));
  CHECK(number_in(found, "world_mpjpe_mm") < 0.5 * number_in(given, "world_mpjpe_mm"));
  CHECK(number_in(found, "root_translation_mm") < 0.5 * number_in(given, "root_translation_mm"));
  CHECK(number_in(found, "object_translation_cm") < 0.5 * number_in(given, "object_translation_cm"));
  CHECK(number_in(found, "psnr_foreground_db") > number_in(given, "psnr_foreground_db") + 3);

  // It stands in the place of frame 0 everywhere.
  const SceneState first = first_state_of("run");
  const Clip clip = read_clip(config.data);
  CHECK_FALSE(same(first, clip.first));
  const nlohmann::json written = json_of("run/summary.json");
  CHECK(written["metrics"][1]["frame"] == 0);
  CHECK(written["metrics"][1]["iterations"] == kBodyIterations);
  CHECK_FALSE(written["metrics"][2].contains("frame"));
  CHECK(written["per_frame"].size() == 1);  // means stay those of the frames after it
  CHECK(fs::exists("run/frames/0000_render.png"));
  const std::vector<nlohmann::json> lines = metrics_of("run");
  CHECK(lines.size() == kFirstIterations + kPerFrame);
  CHECK(lines.front()["frame"] == 0);

  // Frames that follow profit.
  RunConfig plain = load_run_config(dataset / "config.json", {}, descriptions_of(loss_terms()));
  const RunSummary without = execute_tiny(plain, "plain");
  CHECK(same(first_state_of("plain"), clip.first));
  CHECK(number_in(summary.metrics.back().values, "world_mpjpe_mm") <
        0.8 * number_in(without.metrics.back().values, "world_mpjpe_mm"));
}

TEST_CASE("depth as in frame 0 is that of the frame 0 that was found", "[run][first_frame]") {
  const TemporaryFolder here;
  const DisturbedDataset dataset;
  RunConfig config = config_with_first_stages(
      dataset.path, {"stages.interaction.iterations=1", "stages.fit_first_camera.iterations=10",
                     "stages.fit_first_frame.iterations=10"});
  execute_tiny(config, "run");
  const auto depth_of_first_line = [](const fs::path& run) {
    for (const nlohmann::json& line : metrics_of(run)) {
      if (line["frame"] == 1 && line["stage"] == "interaction") return line["losses"]["depth"].get<double>();
    }
    return -1.0;
  };
  // Camera and object of frame 1 begin where those of frame 0 ended, but for what the camera's stage moves.
  config.stages[2].second.optimize[0].second.lr = 0;
  execute_tiny(config, "standing");
  CHECK(depth_of_first_line("standing") < 1e-10);
  CHECK(depth_of_first_line("run") > 1e-10);
}

TEST_CASE("what is solid and shares and starts and the 3D view are of the frame 0 that was found",
          "[run][first_frame]") {
  const TemporaryFolder here;
  const DisturbedDataset dataset;
  const RunConfig config = config_with_first_stages(
      dataset.path,
      {"stages.interaction.iterations=2", "stages.fit_first_camera.iterations=5", "stages.fit_first_frame.iterations=5",
       "stages.fit_first_frame.gradient_shares=1", "start.root=best", "start.objects=best"});
  const RunSummary summary = execute_tiny(config, "run");
  const Clip clip = read_clip(config.data);
  const SceneState found = first_state_of("run");
  REQUIRE(summary.surface == clip.surface_file);
  const MetricValues given_in_solid = penetration_values(penetration_by_frame(clip, {clip.first}).front()),
                     found_in_solid = penetration_values(penetration_by_frame(clip, {found}).front());
  for (const auto& [name, value] : given_in_solid)
    CHECK(number_in(baseline_of(summary, "given_frame_0").values, name) == value);
  for (const auto& [name, value] : found_in_solid) CHECK(number_in(summary.metrics[1].values, name) == value);
  CHECK(find_metric(summary.metrics[0].values, "penetration_share") == nullptr);  // it moves the camera alone
  CHECK(summary.metrics[0].gradient_shares.empty());
  CHECK_FALSE(summary.metrics[1].gradient_shares.empty());
  CHECK(summary.metrics[2].gradient_shares.empty());

  const Safetensors view = Safetensors::read("run/view3d.safetensors");
  const auto cameras = view.array("cameras/poses").as<float>();
  for (int i = 0; i < 3; ++i)
    CHECK(cameras[static_cast<std::size_t>(4 + i)] == static_cast<float>(found.camera_from_world.translation[i]));
  const std::string page = file_text("run/report.html");
  CHECK(page.find("Of frame 0 alone, and compared with each other: ") != std::string::npos);
}

TEST_CASE("a run with stages over the first frame that was stopped and resumed has the bits of one that was not",
          "[run][first_frame]") {
  const TemporaryFolder here;
  const DisturbedDataset dataset;
  const std::vector<std::string> few = {"stages.fit_first_camera.iterations=4", "stages.fit_first_frame.iterations=5",
                                        "color_net.use=on", "color_net.features=4", "color_net.hidden_width=8"};
  RunConfig config = config_with_first_stages(dataset.path, few);
  ParameterGroupSettings moved;
  moved.lr = 0.01;
  config.stages[1].second.optimize.emplace_back("color_net", moved);
  execute_tiny(config, "whole");
  for (const int last : {3, 6, 9, 10, 9 + kPerFrame + 2}) {
    INFO("stopped after iteration " << last);
    const std::string run = "stopped" + std::to_string(last);
    int count = 0;
    const std::string message = last <= 9               ? "interrupted in frame 0; no frame was finished"
                                : last <= 9 + kPerFrame ? "interrupted in frame 1; frame 0 is finished and kept"
                                                        : "interrupted in frame 2; frames 0 to 1 are finished and kept";
    CHECK_THROWS_MATCHES(execute_tiny(config, run, 1, false, [&] { return ++count == last; }), Interrupted,
                         Message(message));
    execute_tiny(config, run, 2, true);
    CHECK(differences("whole", run) == kNone);
  }
}

TEST_CASE("scopes of stages have an order, and frames need stages of their own", "[first_frame]") {
  const auto problems_of = [](const std::vector<StageScope>& scopes) {
    RunConfig config = tiny_config();
    const StageSettings stage = config.stages.back().second;
    config.stages.clear();
    for (std::size_t s = 0; s < scopes.size(); ++s) {
      config.stages.emplace_back(std::string(1, static_cast<char>('a' + s)), stage);
      config.stages.back().second.over = scopes[s];
    }
    std::string text;
    for (const RunProblem& problem : run_problems(config, ConfigUse::kStages)) {
      if (problem.pointer.ends_with("/over")) text += problem.pointer + ": " + problem.text + "\n";
    }
    return text;
  };
  using Scope = StageScope;
  CHECK(problems_of({Scope::kFirst, Scope::kFirst, Scope::kFrame, Scope::kFrame, Scope::kSequence}).empty());
  CHECK(problems_of({Scope::kFrame, Scope::kFirst}) ==
        "/stages/b/over: a stage over the first frame cannot come after \"a\", which is over frames\n");
  CHECK(problems_of({Scope::kFirst, Scope::kFrame, Scope::kSequence, Scope::kFrame, Scope::kFrame}).empty());
  CHECK(problems_of({Scope::kFrame, Scope::kSequence, Scope::kFirst}) ==
        "/stages/c/over: a stage over the first frame cannot come after \"b\", which is over the sequence\n");
  CHECK(problems_of({Scope::kSequence}) ==
        "/stages/a/over: a stage over the sequence needs one over frames before it\n");
  CHECK(problems_of({Scope::kFirst, Scope::kSequence, Scope::kFrame}) ==
        "/stages/b/over: a stage over the sequence needs one over frames before it\n");
  CHECK(problems_of({Scope::kFirst}) ==
        "/stages/a/over: a stage over the first frame needs one over frames after it\n");
  CHECK(problems_of({Scope::kFirst, Scope::kSequence}) ==
        "/stages/a/over: a stage over the first frame needs one over frames after it\n");
}

TEST_CASE("a stage over the first frame moves what one over a frame does", "[first_frame]") {
  const TemporaryFolder here;
  here.write("a.json", R"({"stages": {"first": {"over": "first_frame", "iterations": 3,
    "optimize": {"pose_latents": {"lr": 0.1}}, "losses": {"photometric": {}}}, "frame": {"iterations": 3,
    "optimize": {"transl": {"lr": 0.1}}, "losses": {"photometric": {}}}}})");
  CHECK_THROWS_WITH(load_run_config("a.json", {}, descriptions_of(loss_terms()), ConfigUse::kStages),
                    Catch::Matchers::Contains(
                        "/stages/first/optimize/pose_latents: there is no such parameter group; "
                        "known here: camera, object_orient, object_transl, object_joint, object_light, transl, "));
}

}  // namespace first_frame_test
