// Runs that look for what the files of a clip do not know.
#include <catch2/catch.hpp>

#include "core/camera_file.h"
#include "pipelines/config/run_problems.h"
#include "tests/support/tiny_run.h"

namespace unknowns_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
namespace fs = std::filesystem;

namespace {

constexpr int kIterations = 60;
const std::vector<std::string> kNone;

const char* const kFindFocal = R"({"find_focal_length": {
  "over": "first_frame", "iterations": 60, "draw": "scene", "weight": "unoccluded",
  "optimize": {"focal_length": {"lr": 0.01, "lr_final_share": 0.05}},
  "losses": {"masked_l2": {}}}})";

/// The config of a dataset with a stage before its own, written beside it.
RunConfig config_with(const fs::path& dataset, const char* stages, const std::vector<std::string>& overrides = {}) {
  nlohmann::json content;
  content["stages"] = nlohmann::json::parse(stages);
  content["extends"] = (dataset / "config.json").string();
  const TemporaryFolder here;
  here.write("unknown.json", content.dump());
  return load_run_config("unknown.json", overrides, descriptions_of(loss_terms()));
}

double given_focal(const fs::path& dataset) { return read_camera((dataset / "camera.json").string()).fx; }

/// The tiny dataset, its camera with another focal length than that which filmed it.
struct OtherLens : CopiedDataset {
  explicit OtherLens(double factor) {
    const std::string file = (path / "camera.json").string();
    Camera camera = read_camera(file);
    camera.fx *= factor;
    camera.fy *= factor;
    write_camera(file, camera);
  }
};

}  // namespace

TEST_CASE("a focal length that was given wrong is found, told, and used by all later frames", "[run]") {
  const TemporaryFolder here;
  const OtherLens dataset(1.1);
  const double truth = given_focal(TinyDataset::folder());
  const RunConfig config = config_with(dataset.path, kFindFocal);
  const RunSummary summary = execute_tiny(config, "run");
  REQUIRE(summary.found.size() == 1);
  CHECK(summary.found[0].first == "focal_length_px");
  CHECK(summary.found[0].second == Approx(truth).epsilon(0.01));
  CHECK(json_of("run/summary.json")["found"]["focal_length_px"] == summary.found[0].second);
  const std::vector<Camera> cameras = read_cameras("run/cameras.json");
  CHECK(cameras.back().fx == Approx(summary.found[0].second));
  CHECK(cameras.back().fy / cameras.back().fx == Approx(1));
  CHECK_THAT(file_text("run/log.txt"), Contains("found by stage find_focal_length: focal_length_px "));

  const RunSummary wrong = execute_tiny(config_in(dataset.path, {}), "wrong");
  CHECK(wrong.found.empty());
  CHECK(number_in(summary.metrics.back().values, "psnr_db") > number_in(wrong.metrics.back().values, "psnr_db") + 3);
  CHECK(number_in(summary.metrics.back().values, "camera_translation_cm") <
        0.3 * number_in(wrong.metrics.back().values, "camera_translation_cm"));
}

TEST_CASE("a run that found something, was stopped and resumed has the bits of one that was not", "[run]") {
  const TemporaryFolder here;
  const OtherLens dataset(0.95);
  const RunConfig config = config_with(dataset.path, kFindFocal);
  execute_tiny(config, "whole");
  for (const int last : {kIterations / 2, kIterations + 3, kIterations + kPerFrame + 3}) {
    INFO("stopped after iteration " << last);
    const std::string run = "stopped" + std::to_string(last);
    int count = 0;
    CHECK_THROWS_AS(execute_tiny(config, run, 1, false, [&] { return ++count == last; }), Interrupted);
    execute_tiny(config, run, 2, true);
    CHECK(differences("whole", run) == kNone);
  }
}

TEST_CASE("sizes and a shape are found in one stage, and told", "[run]") {
  const TemporaryFolder here;
  const CopiedDataset dataset;
  RunConfig config = config_with(dataset.path, R"({"find_sizes": {
    "over": "first_frame", "iterations": 4,
    "optimize": {"object_scale": {"lr": 0.3}, "betas": {"lr": 0.1}, "scene_scale": {"lr": 0.01},
                 "scene_height": {"lr": 0.01}},
    "losses": {"photometric": {}, "unknowns_prior": {"weight": 1e-4}}}})");
  config.data.surface.clear();
  const RunSummary summary = execute_tiny(config, "run");
  std::vector<std::string> names;
  for (const auto& [name, value] : summary.found) names.push_back(name);
  REQUIRE(names.size() == 3 + 10);
  CHECK(names[0] == "scene_scale");
  CHECK(names[1] == "object_scale_" + kTinyObject);
  CHECK(names[2] == "scene_height_m");
  CHECK(names[3] == "beta_0");
  CHECK(fs::exists("run/body.glb"));  // the body has the shape that was found
  const Avatar given = read_avatar((dataset.path / "avatar.safetensors").string());
  const Avatar found = read_avatar("run/avatar.safetensors");
  CHECK(found.joints != given.joints);
  CHECK(found.colors == given.colors);
}

TEST_CASE("what is one for a clip is found over the first frame, alone, and of what goes along") {
  const auto problems_of = [](StageScope over, const std::string& group, Draw draw, bool has_surface) {
    RunConfig config = tiny_config();
    if (!has_surface) config.data.surface.clear();
    StageSettings stage = config.stages.back().second;
    stage.over = over;
    stage.draw = draw;
    stage.optimize = {{group, ParameterGroupSettings{}}};
    if (draw == Draw::kScene) stage.losses = config.stages.front().second.losses;
    config.stages.insert(config.stages.begin(), {"a", stage});
    std::string text;
    for (const RunProblem& problem : run_problems(config, ConfigUse::kStages))
      text += problem.pointer + ": " + problem.text + "\n";
    return text;
  };
  using Scope = StageScope;
  CHECK(problems_of(Scope::kFirst, "focal_length", Draw::kScene, true).empty());
  CHECK(problems_of(Scope::kFirst, "scene_scale", Draw::kAll, false).empty());
  CHECK_THAT(problems_of(Scope::kFrame, "focal_length", Draw::kAll, true),
             Contains("/stages/a/optimize/focal_length: is one for the whole clip, which a stage over the first frame "
                      "finds; allowed: \"over\": \"first_frame\""));
  CHECK_THAT(problems_of(Scope::kFirst, "betas", Draw::kScene, true),
             Contains("/stages/a/optimize/betas: there is no such parameter group; known here: camera, focal_length"));
  CHECK_THAT(problems_of(Scope::kFirst, "scene_height", Draw::kAll, true),
             Contains("/stages/a/optimize/scene_height: the mesh of /data/surface does not move with the scene"));
}

TEST_CASE("betas need the body that the avatar was made on", "[run]") {
  const TemporaryFolder here;
  const CopiedDataset dataset;
  const RunConfig config = config_with(dataset.path, R"({"find_shape": {
    "over": "first_frame", "iterations": 2, "optimize": {"betas": {"lr": 0.1}}, "losses": {"photometric": {}}}})",
                                       {"body.shape=[2]"});
  CHECK_THROWS_WITH(
      execute_tiny(config, "run"),
      Contains("/stages/find_shape/optimize/betas: which body the avatar was made on must be known: joints "
               "of the avatar are "));
}

}  // namespace unknowns_test
