#include "pipelines/run/run.h"

#include <cmath>
#include <map>
#include <set>
#include <sstream>

#include <catch2/catch.hpp>

#include "body/motion_io.h"
#include "core/camera_file.h"
#include "core/image_io.h"
#include "core/parallel.h"
#include "pipelines/cli/run_command.h"
#include "pipelines/input/state.h"
#include "tests/support/procedural_file.h"
#include "tests/support/program.h"
#include "tests/support/tiny_run.h"

namespace run_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
using Catch::Matchers::StartsWith;
namespace fs = std::filesystem;

namespace {

std::set<std::string> names_in(const fs::path& folder) {
  std::set<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder)) names.insert(entry.path().filename().string());
  return names;
}

/// Iterations that are enough for a result better than its baselines.
RunConfig longer_config() { return tiny_config({"stages.camera.iterations=30", "stages.interaction.iterations=40"}); }

void check_frames(const fs::path& run) {
  for (int frame = 1; frame < kTinyFrames; ++frame) {
    for (const char* kind : {"target", "render", "difference", "start", "side"}) {
      const std::string file = RunPaths{run}.frame_image(frame, kind);
      INFO(file);
      const Image image = read_image(file);
      CHECK(image.channels() == 3);
      CHECK(image.width() == kTinyPixels);
      CHECK(image.height() == kTinyPixels);
    }
  }
  CHECK(names_in(run / "frames").size() == 5 * (kTinyFrames - 1) + 3);
  for (const char* kind : {"target", "render", "side"}) CHECK(fs::exists(RunPaths{run}.frame_image(0, kind)));
}

void check_metrics_lines(const fs::path& run, int camera_iterations, int interaction_iterations) {
  const std::vector<nlohmann::json> lines = metrics_of(run);
  REQUIRE(lines.size() == static_cast<std::size_t>((kTinyFrames - 1) * (camera_iterations + interaction_iterations)));
  std::size_t at = 0;
  for (int frame = 1; frame < kTinyFrames; ++frame) {
    for (const auto& [stage, iterations] :
         {std::pair{"camera", camera_iterations}, std::pair{"interaction", interaction_iterations}}) {
      for (int i = 0; i < iterations; ++i) {
        const nlohmann::json& line = lines[at++];
        INFO("line " << at << ": " << line.dump());
        REQUIRE(line["frame"] == frame);
        REQUIRE(line["stage"] == stage);
        REQUIRE(line["iteration"] == i);
        REQUIRE(std::isfinite(line["loss"].get<double>()));
        REQUIRE(line["losses"].size() == (std::string(stage) == "camera" ? 1 : 3));
        REQUIRE(line["seconds"].get<double>() > 0);
        REQUIRE(line["tiles"].get<double>() > 0);
        REQUIRE(line["pairs"].get<double>() > 0);
        REQUIRE(line["fragments"].get<double>() >= line["tiles"].get<double>());
        REQUIRE(line["groups"].get<double>() > 0);
        REQUIRE(line["groups"].get<double>() <= line["fragments"].get<double>());
        REQUIRE(line["layers"].get<double>() <= line["tiles"].get<double>());
        REQUIRE(line["adjoint_tiles"].get<double>() > 0);
      }
    }
  }
}

double number_at(const nlohmann::json& object, const char* name) {
  INFO(name << " in " << object.dump());
  REQUIRE(object.contains(name));
  return object[name].get<double>();
}

fs::path shipped_configs() { return fs::path(HSI4D_SOURCE_DIR) / "configs"; }

/// Makes the dataset that a config describes, but for its size, and runs the config on it, or on the tiny one, each
/// stage for two iterations.
void check_small_run(RunConfig config, const std::string& folder, bool on_its_own) {
  INFO(folder);
  for (auto& [stage, settings] : config.stages) {
    settings.iterations = 2;
    for (auto& [group, moved] : settings.optimize) moved.from = 0;  // as later iterations would be
  }
  config.synthetic.frames = 2;
  config.synthetic.clips = 1;  // chains have tests of their own
  config.synthetic.size_px = 32;
  config.synthetic.scene_gaussians = kFewestSceneGaussians;
  config.synthetic.avatar_gaussians = 300;
  config.synthetic.object_gaussians = kFewestObjectGaussians;
  write_dataset(config.synthetic, video_render_settings(), folder + "-dataset", {}, ConfigValue::make_object(),
                config.body);
  CHECK(fs::exists(folder + "-dataset/truth/motion.npz"));
  config.data = dataset_inputs(on_its_own ? fs::path(folder + "-dataset") : TinyDataset::folder());
  const RunSummary summary = execute_tiny(config, folder);
  CHECK(summary.metrics.size() == with_passes(config).stages.size());
  CHECK(number_in(summary.metrics.back().values, "psnr_db") > 10);
  CHECK(json_of(folder + "/status.json")["state"] == "done");
}

/// Runs a shipped config as check_small_run does.
/// @return  whether it has stages: one without is a base for others, or settings of a render or dataset, and runs with
///          those of a tiny one
bool check_shipped_config(const fs::path& file, const std::string& folder, bool on_its_own) {
  RunConfig config = load_run_config(file, {}, descriptions_of(loss_terms()));
  const bool has_stages = !config.stages.empty();
  if (!has_stages) config.stages = tiny_config().stages;
  check_small_run(config, folder, on_its_own);
  return has_stages;
}

}  // namespace

TEST_CASE("a run leaves a whole run folder, and a result better than its baselines", "[run]") {
  const TemporaryFolder here;
  const RunSummary summary = execute_tiny(longer_config(), "run");
  const fs::path run = "run";
  CHECK(names_in(run) == std::set<std::string>{".lock", "body.glb", "cameras.json", "checkpoint",
                                               "config.resolved.json", "frames", "log.txt", "metrics.jsonl",
                                               "motion.npz", "motion_30fps.npz", "objects.npz", "report.html",
                                               "status.json", "summary.json", "view3d.safetensors"});
  CHECK(temporaries_in(run).empty());
  CHECK(json_of(run / "status.json")["state"] == "done");
  CHECK(json_of(run / "status.json")["threads"] == 1);
  CHECK_FALSE(json_of(run / "status.json").contains("message"));
  CHECK(names_in(run / "checkpoint") == std::set<std::string>{"progress.npz"});
  CHECK_THAT(file_text(run / "report.html"), Contains("interaction") && Contains("</html>"));
  CHECK(file_text(run / "config.resolved.json") == resolved_config(longer_config(), descriptions_of(loss_terms())));
  check_metrics_lines(run, 30, 40);
  check_frames(run);

  const nlohmann::json written = json_of(run / "summary.json");
  CHECK(summary_json(parse_summary(file_text(run / "summary.json"), "summary.json")) == summary_json(summary));
  REQUIRE(written["metrics"].size() == 2);
  const nlohmann::json &camera = written["metrics"][0], &last = written["metrics"][1];
  CHECK(camera["stage"] == "camera");
  CHECK(camera["iterations"] == 30 * (kTinyFrames - 1));
  CHECK_FALSE(camera.contains("mpjpe_mm"));
  CHECK(last["stage"] == "interaction");
  for (const char* name :
       {"mpjpe_mm", "pa_mpjpe_mm", "world_mpjpe_mm", "world_mpjpe_image_mm", "world_mpjpe_depth_mm",
        "root_translation_mm", "object_translation_cm", "object_rotation_deg", "camera_translation_cm",
        "camera_rotation_deg", "psnr_db", "psnr_foreground_db", "ssim", "jitter", "seconds"}) {
    CHECK(number_at(last, name) > 0);
  }
  CHECK(last["rollbacks"] == 0);
  REQUIRE(written["per_frame"].size() == kTinyFrames - 1);
  // No rotation of the object: of its few pixels it cannot be told.
  for (const char* baseline : {"start", "copy_frame_0"}) {
    for (const char* name :
         {"mpjpe_mm", "world_mpjpe_mm", "object_translation_cm", "camera_translation_cm", "camera_rotation_deg"}) {
      INFO(name << " against " << baseline);
      CHECK(number_at(last, name) < number_at(written["baselines"][baseline], name));
    }
  }
  CHECK(number_at(last, "psnr_db") > 30);
  for (const char* name : {"psnr_db", "psnr_foreground_db", "ssim"}) {
    INFO(name);
    CHECK(number_at(last, name) > number_at(written["baselines"]["start"], name));
    CHECK(number_at(written["per_frame"][2], name) > number_at(written["baselines_per_frame"]["start"][2], name));
    CHECK_FALSE(written["baselines"]["copy_frame_0"].contains(name));
  }

  const Motion motion = read_motion("run/motion.npz");
  CHECK(motion.frame_rate == 10);
  CHECK(motion.poses.size() == kTinyFrames);
  CHECK(read_cameras("run/cameras.json").size() == kTinyFrames);
  CHECK(read_object_tracks("run/objects.npz", {kTinyObject}).size() == kTinyFrames);
  const Motion given = read_motion((TinyDataset::folder() / "initial_motion.npz").string());
  CHECK(motion.poses[0].axis_angle == given.poses[0].axis_angle);  // frame 0 is given
  CHECK(motion.poses[0].transl == given.poses[0].transl);
  CHECK(motion.poses[3].transl != given.poses[3].transl);
}

TEST_CASE("a run has the same bits for any number of threads", "[run][parallel]") {
  const TemporaryFolder here;
  const RunConfig config = tiny_config();
  execute_tiny(config, "one", 1);
  for (const int threads : {2, 3}) {
    const std::string folder = std::to_string(threads);
    execute_tiny(config, folder, threads);
    CHECK(json_of(folder + "/status.json")["threads"] == threads);
    CHECK(differences("one", folder) == std::vector<std::string>{});
  }
}

TEST_CASE("the comparison of runs sees what differs", "[run]") {
  const TemporaryFolder here;
  execute_tiny(tiny_config({"stages.camera.iterations=1", "stages.interaction.iterations=1"}), "a");
  fs::copy("a", "b", fs::copy_options::recursive);
  CHECK(differences("a", "b").empty());
  fs::copy_file("b/frames/0001_target.png", "b/frames/0002_target.png", fs::copy_options::overwrite_existing);
  fs::remove("b/frames/0003_render.png");
  CHECK(differences("a", "b").size() == 2);
  execute_tiny(tiny_config({"stages.camera.iterations=1", "stages.interaction.iterations=2"}), "c");
  CHECK(differences("a", "c").size() > 5);
}

TEST_CASE("a run without truth has no errors against it, but images", "[run]") {
  const TemporaryFolder here;
  RunConfig config = tiny_config();
  config.data.truth.clear();
  const RunSummary summary = execute_tiny(config, "run");
  REQUIRE(summary.baselines.size() == 1);  // the image that the run was given
  CHECK(summary.baselines[0].name == "start");
  CHECK(summary.baselines[0].values.size() ==
        16);  // of images, their background, the surfaces, contact, feet and the jitter
  REQUIRE(summary.baselines[0].per_frame.size() == kTinyFrames - 1);
  CHECK(number_in(summary.baselines[0].per_frame[2].values, "psnr_db") > 10);
  for (const StageSummary& stage : summary.metrics) {
    for (const char* name : {"mpjpe_mm", "object_translation_cm", "camera_translation_cm"}) {
      INFO(stage.stage << " " << name);
      CHECK(find_metric(stage.values, name) == nullptr);
    }
  }
  REQUIRE(summary.per_frame.size() == kTinyFrames - 1);
  CHECK(summary.per_frame[2].frame == 3);
  CHECK(number_in(summary.per_frame[2].values, "psnr_db") > 15);
  CHECK(number_in(summary.metrics.back().values, "psnr_db") > 15);
  CHECK(number_in(summary.metrics.back().values, "ssim") > 0.3);
  CHECK(fs::exists("run/report.html"));
}

TEST_CASE("a run without objects has no terms and no files of them", "[run]") {
  const TemporaryFolder here;
  RunConfig config = tiny_config();
  config.data.objects.clear();
  const RunSummary summary = execute_tiny(config, "run");
  CHECK_FALSE(fs::exists("run/objects.npz"));
  CHECK(find_metric(summary.metrics.back().values, "object_translation_cm") == nullptr);
  CHECK(number_in(summary.metrics.back().values, "mpjpe_mm") > 0);
  for (const nlohmann::json& line : metrics_of("run")) {
    INFO(line.dump());
    CHECK_FALSE(line["losses"].contains("center"));
    CHECK_FALSE(line["losses"].contains("depth"));
  }
}

TEST_CASE("without estimates every frame starts from the one before", "[run]") {
  const TemporaryFolder here;
  const fs::path data = fs::absolute("data");
  fs::copy(TinyDataset::folder(), data, fs::copy_options::recursive);
  Motion motion = read_motion((data / "initial_motion.npz").string());
  motion.poses.resize(1);
  write_motion((data / "initial_motion.npz").string(), motion);
  const RunConfig config = load_run_config(data / "config.json", {}, descriptions_of(loss_terms()));
  const RunSummary summary = execute_tiny(config, "run");
  REQUIRE(summary.baselines.size() == 2);
  CHECK(number_in(summary.baselines[0].values, "mpjpe_mm") == number_in(summary.baselines[1].values, "mpjpe_mm"));
  const Motion result = read_motion("run/motion.npz");
  REQUIRE(result.poses.size() == kTinyFrames);
  const Index finger = 3 * 30;  // fingers are not optimised: they stay as in frame 0
  for (const BodyPose& pose : result.poses) {
    CHECK(std::equal(pose.axis_angle.begin() + finger, pose.axis_angle.end(),
                     motion.poses[0].axis_angle.begin() + finger));
  }
  CHECK(result.poses[3].transl != motion.poses[0].transl);
}

TEST_CASE("estimated limbs are where frames start from, the root is the one before's", "[run]") {
  const TemporaryFolder here;
  RunConfig config = tiny_config();
  std::erase_if(config.stages.back().second.optimize,  // the body stays where frames start
                [](const auto& group) { return group.first != "object_transl"; });
  execute_tiny(config, "run");
  const Motion result = read_motion("run/motion.npz");
  const Motion given = read_motion((TinyDataset::folder() / "initial_motion.npz").string());
  for (std::size_t t = 1; t < result.poses.size(); ++t) {
    INFO("frame " << t);
    CHECK(result.poses[t].transl == given.poses[0].transl);
    CHECK(result.poses[t].rotation_of(0) == given.poses[0].rotation_of(0));
    CHECK(std::equal(result.poses[t].axis_angle.begin() + 3, result.poses[t].axis_angle.end(),
                     given.poses[t].axis_angle.begin() + 3));
  }
}

TEST_CASE("a run in double and with axis-angles finds about what one in float finds", "[run]") {
  const TemporaryFolder here;
  const RunSummary plain = execute_tiny(tiny_config(), "float");
  const RunSummary precise = execute_tiny(tiny_config({"precision=double"}), "double");
  CHECK(json_of("double/status.json")["precision"] == "double");
  const RunSummary vectors = execute_tiny(tiny_config({"rotations=axis_angle"}), "vectors");
  const auto last = [](const RunSummary& summary, const char* name) {
    return number_in(summary.metrics.back().values, name);
  };
  CHECK(last(precise, "mpjpe_mm") == Approx(last(plain, "mpjpe_mm")).epsilon(0.05));
  CHECK(last(precise, "psnr_db") == Approx(last(plain, "psnr_db")).epsilon(0.01));
  CHECK(last(precise, "mpjpe_mm") != last(plain, "mpjpe_mm"));
  CHECK(last(vectors, "mpjpe_mm") < number_in(vectors.baselines[0].values, "mpjpe_mm"));
  CHECK(last(vectors, "mpjpe_mm") != last(plain, "mpjpe_mm"));
  CHECK(last(vectors, "psnr_db") == Approx(last(plain, "psnr_db")).margin(2));
}

TEST_CASE("the camera is found with increments in any frame", "[run]") {
  const TemporaryFolder here;
  std::set<double> found;
  for (const char* increment : {"camera", "world", "scene"}) {
    INFO(increment);
    const RunSummary summary = execute_tiny(
        tiny_config({std::string("camera.increment=") + increment, "stages.camera.iterations=30"}), increment);
    const double error = number_in(summary.metrics[0].values, "camera_rotation_deg");
    CHECK(error < number_in(summary.baselines[0].values, "camera_rotation_deg"));
    found.insert(error);
  }
  CHECK(found.size() == 3);
}

TEST_CASE("a dry run and a printed config write nothing, seed and threads are noted", "[run]") {
  const TemporaryFolder here;
  const std::string config = tiny_config_file();
  const ProgramResult plan = run_hsi4d({"run", config, "--dry-run", "--out", "out"});
  CHECK(plan.status == 0);
  CHECK(plan.err.empty());
  CHECK_THAT(plan.out, Contains("would write out\n  4 frames of 48x48, scene of "));
  CHECK_THAT(plan.out, Contains("  object watering_can of "));
  CHECK_THAT(plan.out, Contains("  stage camera: 8 iterations a frame\n  stage interaction: 10 iterations a frame\n"));
  CHECK_THAT(run_hsi4d({"run", config, "--dry-run"}).out, Contains("would write runs/tiny\n"));

  const ProgramResult printed = run_hsi4d({"run", config, "--print-config", "--seed", "5"});
  CHECK(printed.status == 0);
  CHECK(printed.err.empty());
  CHECK(printed.out == resolved_config(tiny_config({"seed=5"}), descriptions_of(loss_terms())));
  CHECK(names_in(".") == std::set<std::string>{"stdout.txt", "stderr.txt"});

  const ProgramResult done =
      run_hsi4d({"run", config, "--seed", "5", "--threads", "2", "--set", "stages.interaction.iterations=1"});
  CHECK(done.status == 0);
  CHECK_THAT(done.out, Contains("copy_frame_0") && Contains("report: runs/tiny/report.html\n"));
  const nlohmann::json status = json_of("runs/tiny/status.json");
  CHECK(status["seed"] == 5);
  CHECK(status["threads"] == 2);
  CHECK(json_of("runs/tiny/config.resolved.json")["seed"] == 5);
  CHECK(json_of("runs/tiny/config.resolved.json")["threads"] == 0);
  for (const char* bad : {"-1", "1025", "many"}) {
    const ProgramResult refused = run_hsi4d({"run", config, "--threads", bad});
    CHECK(refused.status == 2);
    CHECK_THAT(refused.err, Contains("hsi4d run: --threads: \"" + std::string(bad) +
                                     "\" is out of range, or not a whole number; allowed: 0 to 1024"));
  }
  CHECK(cli::run_threads(std::nullopt) == 0);  // what the config says
  CHECK(cli::run_threads(0) == thread_count());
  CHECK(cli::run_threads(3) == 3);
}

TEST_CASE("a dry run looks at the folder as the run would", "[run]") {
  const TemporaryFolder here;
  const std::string config = tiny_config_file();
  int count = 0;
  CHECK_THROWS_AS(execute_tiny(tiny_config(), "runs/tiny", 1, false, [&] { return ++count == 25; }), Interrupted);
  // Without --out the next folder that is free.
  CHECK_THAT(run_hsi4d({"run", config, "--dry-run"}).out, StartsWith("would write runs/tiny-2\n"));
  const auto before = file_text("runs/tiny/status.json");
  const ProgramResult taken = run_hsi4d({"run", config, "--dry-run", "--out", "runs/tiny"});
  CHECK(taken.status == 2);
  CHECK_THAT(taken.err, StartsWith("runs/tiny: holds a run that is not finished (interrupted)"));
  CHECK_THAT(
      run_hsi4d({"run", config, "--dry-run", "--resume"}).out,
      StartsWith("would go on with runs/tiny (interrupted): 1 of 3 frames are finished, 2 are left\n  4 frames"));
  CHECK_THAT(run_hsi4d({"run", config, "--dry-run", "--resume", "--seed", "9"}).err,
             Contains("the run cannot be resumed, its config is another one:\n  /seed: 0 in the folder, 9 now"));
  CHECK_THAT(run_hsi4d({"run", config, "--dry-run", "--out", TinyDataset::folder().string()}).err,
             Contains("is not empty and holds no run"));
  CHECK(file_text("runs/tiny/status.json") == before);
  here.write("runs/tiny-2/any.txt", "");
  CHECK(run_hsi4d({"run", config, "--resume"}).err ==
        "hsi4d run: --resume needs --out: there are several runs called tiny, from runs/tiny on\n");
}

TEST_CASE("every shipped config runs", "[run]") {
  const TemporaryFolder here;
  std::set<std::string> with_stages, without;
  for (const std::string& name : names_in(shipped_configs())) {
    if (!name.ends_with(".json")) continue;  // of folders see below; those of other commands have their tests
    const std::string stem = fs::path(name).stem().string();
    (check_shipped_config(shipped_configs() / name, stem, false) ? with_stages : without).insert(stem);
  }
  CHECK(with_stages == std::set<std::string>{"best", "demo", "demo_quick", "fast", "find_focal_length",
                                             "fit_first_frame", "from_keypoints", "from_video", "paper",
                                             "paper_static"});
  CHECK(without == std::set<std::string>{"default"});
}

TEST_CASE("every shipped config of a generated dataset runs", "[run][full]") {
  const TemporaryFolder here;
  std::set<std::string> with_stages;
  for (const std::string& name : names_in(shipped_configs() / "synthetic")) {
    if (!name.ends_with(".json")) continue;  // a folder of more
    const std::string stem = fs::path(name).stem().string();
    if (check_shipped_config(shipped_configs() / "synthetic" / name, stem, true)) with_stages.insert(stem);
  }
  CHECK(with_stages == std::set<std::string>{"alone", "chain", "disturbed", "faults", "full_size", "gate", "hidden",
                                             "table", "two_people", "walk"});
}

TEST_CASE("every shipped config of a benchmark runs", "[run]") {
  const TemporaryFolder here;
  std::set<std::string> with_stages;
  for (const std::string& name : names_in(shipped_configs() / "bench")) {
    if (!name.ends_with(".json")) continue;  // what empty_scene reads
    const std::string stem = fs::path(name).stem().string();
    if (check_shipped_config(shipped_configs() / "bench" / name, stem, true)) with_stages.insert(stem);
  }
  CHECK(with_stages == std::set<std::string>{"empty_scene", "fast_scale", "near_human", "no_object", "paper_scale",
                                             "pareto_tracking", "static_camera"});
  const RunConfig usual =
                      load_run_config(shipped_configs() / "bench/paper_scale.json", {}, descriptions_of(loss_terms())),
                  still = load_run_config(shipped_configs() / "bench/static_camera.json", {},
                                          descriptions_of(loss_terms()));
  CHECK(still.stages.size() + 1 == usual.stages.size());
  for (const auto& [name, stage] : still.stages) {  // written once more, as stages cannot be left out by extending
    INFO(name);
    CHECK(stage.iterations == find_entry(usual.stages, name)->iterations);
    const auto names = [](const auto& entries) {
      std::vector<std::string> all;
      for (const auto& entry : entries) all.push_back(entry.first);
      return all;
    };
    CHECK(names(stage.optimize) == names(find_entry(usual.stages, name)->optimize));
    CHECK(names(stage.losses) == names(find_entry(usual.stages, name)->losses));
  }
  CHECK_FALSE(fs::exists("no_object/objects.npz"));
  const std::string scene = read_text_file("empty_scene-dataset/scene.ply").substr(0, 200);
  CHECK_THAT(scene, Contains("element vertex 1\n"));
  const auto human_share = [](const char* dataset) {
    const Image mask = read_image((fs::path(dataset) / "masks/human/0001.png").string());
    double sum = 0;
    for (int y = 0; y < mask.height(); ++y)
      for (int x = 0; x < mask.width(); ++x) sum += mask.row(0, y)[x];
    return sum / (mask.height() * mask.width());
  };
  CHECK(human_share("near_human-dataset") > 0.45);  // 0.49 of many Gaussians; the few of here are wide
  CHECK(human_share("paper_scale-dataset") < 0.15);
}

TEST_CASE("every instance of AnyInteraction has a stand-in that runs", "[run][full]") {
  const TemporaryFolder here;
  std::set<std::string> names, scenes, objects, prompts;
  for (const std::string& name : names_in(shipped_configs() / "anyinteraction")) {
    if (!name.ends_with(".json") || name == "base.json") continue;
    const std::string stem = fs::path(name).stem().string();
    const RunConfig config =
        load_run_config(shipped_configs() / "anyinteraction" / name, {}, descriptions_of(loss_terms()));
    INFO(stem);
    CHECK(config.name == stem);
    CHECK(config.instance.folder.filename() == stem);
    CHECK(config.synthetic.variation == 1);
    const std::string object(choice_name<SyntheticObjectKind>(kSyntheticObjectKinds, config.synthetic.object));
    CHECK(config.instance.object == (object == "none" ? "static" : object));
    names.insert(stem);
    scenes.insert(config.instance.scene);
    objects.insert(config.instance.object);
    prompts.insert(config.instance.prompt);
    check_small_run(config, stem, true);
  }
  CHECK(names.size() == 22);
  CHECK(scenes.size() == 12);
  CHECK(objects.size() == 8);   // seven, and none
  CHECK(prompts.size() == 19);  // two chairs, two cans, two guitars
  const RunConfig base = load_run_config(shipped_configs() / "anyinteraction/base.json", {},
                                         descriptions_of(loss_terms())),
                  paper = load_run_config(shipped_configs() / "paper.json", {}, descriptions_of(loss_terms()));
  RunConfig without = paper;
  std::erase_if(without.stages, [](const auto& stage) { return stage.first == "refinement"; });
  without.synthetic = base.synthetic;
  CHECK(resolved_config(base, descriptions_of(loss_terms())) ==
        resolved_config(without, descriptions_of(loss_terms())));
}

TEST_CASE("where the data of an instance is there it is the run's") {
  const TemporaryFolder here;
  fs::copy(TinyDataset::folder(), "data", fs::copy_options::recursive);
  here.write("one.json", R"({"instance": {"folder": "data"}})");
  const RunConfig config = load_run_config("one.json", {}, descriptions_of(loss_terms()));
  CHECK(config.data.scene.filename() == "scene.ply");
  CHECK(config.data.objects.size() == 1);
  here.write("two.json", R"({"instance": {"folder": "data"}, "data": {"camera": "one.json"}})");
  CHECK(load_run_config("two.json", {}, descriptions_of(loss_terms())).data.camera.filename() == "one.json");
  here.write("three.json", R"({"instance": {"folder": "nowhere"}})");
  CHECK(load_run_config("three.json", {}, descriptions_of(loss_terms())).data.scene.empty());
}

TEST_CASE("every shipped ablation runs", "[run][full]") {
  const TemporaryFolder here;
  int count = 0;
  for (const std::string& name : names_in(shipped_configs() / "ablations")) {
    if (!name.ends_with(".json")) continue;
    CHECK(check_shipped_config(shipped_configs() / "ablations" / name, fs::path(name).stem().string(), false));
    ++count;
  }
  CHECK(count == 20);
}

TEST_CASE("the ablation of the refinement is the best config without it") {
  const auto read = [](const fs::path& file) {
    return load_run_config(shipped_configs() / file, {}, descriptions_of(loss_terms()), ConfigUse::kStages);
  };
  RunConfig without = read("best.json");
  const RunConfig ablation = read("ablations/no_refinement.json");
  std::erase_if(without.stages, [](const auto& stage) { return stage.first == "refinement"; });
  without.passes.count = 1;  // as many iterations at once
  for (auto& [name, stage] : without.stages)
    if (name == "interaction") stage.iterations = 200;
  without.name = ablation.name;
  CHECK(resolved_config(ablation, descriptions_of(loss_terms())) ==
        resolved_config(without, descriptions_of(loss_terms())));
}

TEST_CASE("every shipped clip of the accuracy table runs", "[run][full]") {
  const TemporaryFolder here;
  for (const std::string& name : names_in(shipped_configs() / "synthetic" / "clips")) {
    const fs::path file = shipped_configs() / "synthetic" / "clips" / name;
    RunConfig config = load_run_config(file, {}, descriptions_of(loss_terms()));
    config.stages = tiny_config().stages;  // theirs come from another file, which has its test above
    check_small_run(config, fs::path(name).stem().string(), true);
  }
}

TEST_CASE("the shipped example of real Gaussians runs with others in their places", "[run]") {
  const TemporaryFolder here;
  fs::create_directories("tree/runs/robot");
  fs::copy(shipped_configs(), "tree/configs", fs::copy_options::recursive);
  fs::copy_file(fs::path(HSI4D_SOURCE_DIR) / "tests/assets/playbot_ground_crop.ply", "tree/runs/robot/ground.ply");
  fs::copy_file(TinyDataset::folder() / "objects" / (kTinyObject + ".ply"), "tree/runs/robot/robot.ply");
  procedural_file().write("tree/runs/robot/body.npz");
  RunConfig config =
      load_run_config("tree/configs/examples/robot.json", {"body.betas=0"}, descriptions_of(loss_terms()));
  CHECK(fs::exists(config.synthetic.scene_file));
  CHECK(fs::exists(config.synthetic.object_file));
  CHECK(config.body.kind == BodyKind::kSmplx);
  check_small_run(config, "robot", true);
}

TEST_CASE("every shipped config has a test") {
  std::set<std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(shipped_configs())) {
    const fs::path place = fs::relative(entry.path(), shipped_configs());
    if (entry.is_regular_file() && place.has_parent_path()) files.insert(place.generic_string());
  }
  // Those at the top, of ablations/, anyinteraction/, bench/, synthetic/ and synthetic/clips/ are looked for by the
  // tests above, those of sources/ by sources_test.cpp, those of reconstruct/ by scan_test.cpp, and each of synthetic/
  // by synthetic_test.cpp too.
  std::erase_if(files, [](const std::string& file) {
    return file.starts_with("synthetic/") || file.starts_with("bench/") || file.starts_with("anyinteraction/") ||
           file.starts_with("ablations/") || file.starts_with("reconstruct/") ||
           file.starts_with("sweeps/") ||  // sweep_configs_test.cpp
           (file.starts_with("sources/") && file.ends_with(".json"));
  });
  CHECK(files == std::set<std::string>{"avatar/fit.json", "avatar/from_run.json",
                                       "avatar/views.json",    // avatar_fit_test.cpp
                                       "examples/robot.json",  // above
                                       "sources/README.md"});
}

TEST_CASE("the whole demo is as accurate as the project promises", "[full][demo]") {
  const TemporaryFolder here;
  const ProgramResult demo = run_hsi4d({"demo", "--quiet", "--out", "demo"});
  INFO(demo.err);
  INFO(demo.out);
  REQUIRE(demo.status == 0);
  const nlohmann::json config = json_of("demo/run/config.resolved.json"), summary = json_of("demo/run/summary.json");
  CHECK(config["synthetic"]["size_px"] == 512);
  CHECK(summary["frames"] == 16);
  REQUIRE(summary["metrics"].size() == 3);
  const nlohmann::json &interaction = summary["metrics"][1], &last = summary["metrics"][2];
  CHECK(last["stage"] == "refinement");
  CHECK(number_at(last, "mpjpe_mm") <= 20);
  CHECK(number_at(last, "world_mpjpe_mm") <= 50);
  CHECK(number_at(last, "object_translation_cm") <= 1.5);
  CHECK(number_at(last, "object_rotation_deg") <= 2);
  CHECK(number_at(last, "camera_rotation_deg") <= 0.15);
  CHECK(number_at(last, "camera_translation_cm") <= 1);
  CHECK(number_at(last, "psnr_foreground_db") >= 26);
  CHECK(number_at(last, "world_mpjpe_mm") <= 1.02 * number_at(interaction, "world_mpjpe_mm"));
  CHECK(number_at(last, "jitter") < number_at(interaction, "jitter"));
}

TEST_CASE("the paper's schedule finds camera, body and object of a clip, and its refinement does something", "[full]") {
  const TemporaryFolder here;
  const std::string clip = (shipped_configs() / "synthetic/clips/terrace_wave_guitar.json").string();
  REQUIRE(run_hsi4d({"synth", clip, "--quiet", "--set", "synthetic.size_px=256", "--set", "synthetic.frames=12",
                     "--out", "clip"})
              .status == 0);
  here.write("clip/paper.json", nlohmann::json({{"extends", (shipped_configs() / "paper.json").string()},
                                                {"data", json_of("clip/config.json")["data"]}})
                                    .dump());
  const ProgramResult run = run_hsi4d({"run", "clip/paper.json", "--quiet", "--out", "run"});
  INFO(run.err);
  INFO(run.out);
  REQUIRE(run.status == 0);
  const nlohmann::json summary = json_of("run/summary.json");
  REQUIRE(summary["metrics"].size() == 3);
  const nlohmann::json &start = summary["baselines"]["start"], &interaction = summary["metrics"][1],
                       &last = summary["metrics"][2];
  CHECK(number_at(last, "camera_translation_cm") <= 1);
  CHECK(number_at(last, "object_translation_cm") <= 5);
  CHECK(number_at(last, "mpjpe_mm") <= 0.5 * number_at(start, "mpjpe_mm"));
  CHECK(number_at(last, "world_mpjpe_mm") <= 1.02 * number_at(interaction, "world_mpjpe_mm"));
  CHECK(number_at(last, "jitter") <= 0.9 * number_at(interaction, "jitter"));
}

TEST_CASE("the demo halves the errors of what it is given, and tells them", "[full][demo]") {
  const TemporaryFolder here;
  const ProgramResult demo = run_hsi4d({"demo", "--quick", "--quiet", "--out", "demo"});
  INFO(demo.err);
  INFO(demo.out);
  REQUIRE(demo.status == 0);
  CHECK(demo.err.empty());
  const nlohmann::json config = json_of("demo/run/config.resolved.json"), summary = json_of("demo/run/summary.json");
  CHECK(config["synthetic"]["size_px"] == 256);
  CHECK(config["synthetic"]["frames"] == 8);
  CHECK(summary["frames"] == 8);
  const nlohmann::json& last = summary["metrics"].back();
  for (const char* name :
       {"mpjpe_mm", "object_translation_cm", "object_rotation_deg", "camera_translation_cm", "camera_rotation_deg"}) {
    for (const char* baseline : {"start", "copy_frame_0"}) {
      INFO(name << " against " << baseline);
      CHECK(number_at(last, name) <= 0.5 * number_at(summary["baselines"][baseline], name));
    }
  }
  for (const char* name : {"world_mpjpe_mm", "world_mpjpe_image_mm", "world_mpjpe_depth_mm"}) {
    CHECK(number_at(last, name) > 0);
  }
  // What it prints is that summary: every row has its numbers under its columns.
  CHECK_THAT(demo.out, Contains(error_text(parse_summary(file_text("demo/run/summary.json"), "summary.json"))));
  std::map<std::string, std::vector<double>> rows;  // by label
  std::istringstream lines(demo.out);
  for (std::string line; std::getline(lines, line);) {
    const std::size_t unit_end = line.find(']');
    if (unit_end == std::string::npos) continue;
    std::istringstream words(line.substr(unit_end + 1));
    for (std::string word; words >> word;)
      rows[line.substr(0, unit_end + 1)].push_back(word == "-" ? 0 : std::stod(word));
  }
  for (const char* label : {"MPJPE [mm]", "world MPJPE [mm]", "object position [cm]", "camera position [cm]"}) {
    INFO(label);
    REQUIRE(rows[label].size() == 5);  // start, copy_frame_0, camera, interaction, refinement
    for (const double error : {rows[label][3], rows[label][4]}) {
      CHECK(error > 0);
      CHECK(error < rows[label][0]);
      CHECK(error < rows[label][1]);
    }
  }
}

TEST_CASE("a dataset without its truth gives the same result, and the summary says what is missing", "[run]") {
  const TemporaryFolder here;
  const CopiedDataset dataset;
  const std::string config = (dataset.path / "config.json").string();
  REQUIRE(run_hsi4d({"run", config, "--out", "with", "--threads", "1"}).status == 0);
  fs::remove_all(dataset.path / "truth");
  CHECK_THAT(run_hsi4d({"run", config, "--out", "dry", "--dry-run"}).out, StartsWith("would write dry\n"));
  const ProgramResult run = run_hsi4d({"run", config, "--out", "without", "--threads", "1"});
  INFO(run.err);
  REQUIRE(run.status == 0);
  CHECK_THAT(run.err,
             Contains((dataset.path / "truth").string() +
                      ": there is no such file or folder (data.truth); the result is not compared with the truth"));
  CHECK_THAT(run.out, Contains("PSNR [dB]") &&
                          Contains("no ground truth: errors of body, objects and camera are not measured\n"));
  CHECK_THAT(run.out, !Contains("MPJPE"));
  CHECK_THAT(file_text("without/report.html"), Contains("The run had no ground truth"));
  for (const char* name : {"motion.npz", "objects.npz", "cameras.json"}) {
    INFO(name);
    CHECK(file_text(fs::path("with") / name) == file_text(fs::path("without") / name));
  }
  const nlohmann::json known = json_of("with/summary.json"), unknown = json_of("without/summary.json");
  CHECK(known["truth"] == true);
  CHECK(unknown["truth"] == false);
  CHECK(known["metrics"].back().contains("mpjpe_mm"));
  for (const char* name : {"mpjpe_mm", "object_translation_cm", "camera_rotation_deg"})
    CHECK_FALSE(unknown["metrics"].back().contains(name));
  CHECK(number_at(unknown["metrics"].back(), "psnr_db") == number_at(known["metrics"].back(), "psnr_db"));
}

}  // namespace run_test
