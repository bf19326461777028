// A run that has depth maps: the body goes to where they say, from a wrong depth.
#include <cmath>

#include <catch2/catch.hpp>

#include "body/motion_io.h"
#include "core/image_io.h"
#include "core/log.h"
#include "pipelines/draw/frame_images.h"
#include "pipelines/graph/frame_graph.h"
#include "tests/support/program.h"
#include "tests/support/tiny_run.h"

namespace depth_map_run_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
namespace fs = std::filesystem;

namespace {

/// Disparities of the truth, of some scale and shift, as files of the frames' names.
void write_true_maps(const Clip& clip, const fs::path& folder) {
  fs::create_directory(folder);
  for (std::size_t t = 0; t < clip.truth->size(); ++t) {
    const SceneState& state = (*clip.truth)[t];
    Tape<float> tape;
    FrameGraphSettings settings;
    settings.depth_map = true;
    FrameGraph<float> graph(tape, clip, state.camera_from_world, settings);
    graph.set_state(state);
    tape.forward(graph.loss_inputs().depth);
    Image map = to_image(tape.value(graph.loss_inputs().depth));
    for (float& z : map.data()) z = z > 0 ? 0.2F + 0.9F / z : 0;
    write_image((folder / clip.frame_files[t]).replace_extension(".exr").string(), map);
  }
}

/// Mean distance of the pelvis from the truth's along the camera's view, frame 0 left out, metres.
double depth_error(const Clip& clip, const std::vector<BodyPose>& poses) {
  double sum = 0;
  for (std::size_t t = 1; t < poses.size(); ++t) {
    const SceneState& truth = (*clip.truth)[t];
    sum += std::abs((truth.camera_from_world.rotation * (poses[t].transl - truth.body.transl))[2]);
  }
  return sum / static_cast<double>(poses.size() - 1);
}

/// The poses that frames start from, further away than they are.
void move_estimate_away(const CopiedDataset& dataset, const Clip& clip, double metres) {
  const std::string file = (dataset.path / "initial_motion.npz").string();
  Motion motion = read_motion(file);
  motion.poses = bodies_of(*clip.truth);
  const Vector3<double> away = clip.camera.camera_from_world.rotation.transpose() * Vector3<double>(0, 0, metres);
  for (std::size_t t = 1; t < motion.poses.size(); ++t) motion.poses[t].transl += away;
  write_motion(file, motion);
}

fs::path changed_config(const CopiedDataset& dataset, const char* kind) {
  const fs::path file = dataset.path / "changed.json";
  write_changed(dataset.path / "config.json", file, [kind](auto& c) {
    c["data"]["depth_maps"] = "maps";
    auto& stage = c["stages"]["interaction"];
    stage["iterations"] = 60;
    stage["losses"] = {{"depth_map", {{"kind", kind}}}};
    stage["optimize"] = {{"transl", {{"lr", 0.03}, {"lr_final_share", 0.05}}}};
  });
  return file;
}

}  // namespace

TEST_CASE("depth maps of any scale bring the body to its depth", "[run]") {
  const CopiedDataset dataset;
  const Clip clip = dataset.read();
  write_true_maps(clip, dataset.path / "maps");
  move_estimate_away(dataset, clip, 0.4);
  const fs::path file = changed_config(dataset, "disparity"), run = dataset.folder.path() / "run";
  const RunConfig config = load_run_config(file, {}, descriptions_of(loss_terms()), ConfigUse::kRun);
  execute_tiny(config, run.string());
  const double before = depth_error(clip, read_motion((dataset.path / "initial_motion.npz").string()).poses),
               after = depth_error(clip, read_motion((run / "motion.npz").string()).poses);
  INFO(before << " m before, " << after << " m after");
  CHECK(before > 0.35);
  CHECK(after < 0.25 * before);

  RunConfig opposite =
      load_run_config(changed_config(dataset, "depth"), {}, descriptions_of(loss_terms()), ConfigUse::kRun);
  opposite.stages.back().second.iterations = 1;
  std::string told;
  const LogSink sink = log_to([&told](LogLevel, std::string_view text) { told += text; }, LogLevel::kWarning);
  execute_tiny(opposite, (dataset.folder.path() / "opposite").string());
  CHECK_THAT(told, Contains("stage interaction: the loss \"depth_map\" has no effect in frame 1, in some iterations at "
                            "least: the map grows where the rendered depths, or disparities, fall; its kind may be the "
                            "other one"));

  // They are inputs: other ones are another run, and the message says so.
  Image map = read_image((dataset.path / "maps" / "0001.exr").string());
  map(0, 3, 4) += 1;
  write_image((dataset.path / "maps" / "0001.exr").string(), map);
  fs::remove(run / "status.json");
  CHECK_THROWS_WITH(execute_tiny(config, run.string(), 1, true),
                    Contains("0001.exr: is not what the run began with (depth_maps/0001.exr)"));
}

TEST_CASE("without depth maps the term is off, which is told", "[run]") {
  const CopiedDataset dataset;
  write_changed(dataset.path / "config.json", dataset.path / "changed.json", [](auto& c) {
    for (auto& stage : c["stages"]) stage["iterations"] = 1;
    c["stages"]["interaction"]["losses"]["depth_map"] = {{"weight", 1}};
  });
  const std::string config = (dataset.path / "changed.json").string();
  const ProgramResult result =
      run_hsi4d({"run", config, "--threads", "1", "--out", (dataset.folder.path() / "run").string()});
  INFO(result.err);
  CHECK(result.status == 0);
  CHECK_THAT(result.err, Contains("the loss \"depth_map\" is off: "));
  CHECK_THAT(result.err, Contains("stages.interaction: without data.depth_maps its loss depth_map is off"));
  write_changed(dataset.path / "config.json", dataset.path / "unread.json",
                [](auto& c) { c["data"]["depth_maps"] = "frames"; });
  CHECK_THAT(run_hsi4d({"check", (dataset.path / "unread.json").string()}).out,
             Contains("note: data.depth_maps does nothing: no stage has the loss depth_map"));
  write_changed(dataset.path / "changed.json", dataset.path / "scene.json", [](auto& c) {
    c["stages"]["camera"]["losses"]["depth_map"] = {{"weight", 1}};
  });
  CHECK_THAT(run_hsi4d({"check", (dataset.path / "scene.json").string()}).err,
             Contains("/stages/camera/losses/depth_map: this loss needs everything in an image, which a stage with "
                      "\"draw\": \"scene\" does not have"));
}

}  // namespace depth_map_run_test
