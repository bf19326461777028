// Runs on videos with the faults of generated ones. [paper, D.1 and D.2; D.3 is in color_net_test.cpp]
#include <catch2/catch.hpp>

#include "core/check.h"
#include "pipelines/synthetic/render.h"
#include "tests/support/tiny_run.h"

namespace faults_test {

using namespace hsi4d;
using namespace hsi4d::test;
namespace fs = std::filesystem;

namespace {

/// A short walk, or what else is done, with faults.
void write_faulty(const fs::path& folder, const SyntheticFaults& faults, SyntheticMotionKind motion, Index frames) {
  SyntheticSettings settings = TinyDataset::settings();
  settings.frames = frames;
  settings.camera_drift = 0.3;
  settings.camera_distance = 0.7;
  settings.size_px = 80;
  settings.scene_gaussians = 3000;
  settings.avatar_gaussians = 1000;
  settings.motion = motion;
  settings.faults = faults;
  ConfigProblems problems;
  write_dataset(settings, video_render_settings(), folder, {},
                load_config_text(kTinyStages, "tiny.json", folder.parent_path(), {}, problems));
}

/// Of a run of the camera's stage alone, centimetres.
double camera_error(const fs::path& dataset, const std::string& weight, const std::string& out) {
  RunConfig config = config_in(dataset, {"stages.camera.weight=" + weight, "stages.camera.iterations=30"});
  std::erase_if(config.stages, [](const auto& stage) { return stage.first != "camera"; });
  return last_number(execute_tiny(config, out), "camera_translation_cm");
}

}  // namespace

TEST_CASE("content that is invented where a human once was misleads a camera that forgets its masks", "[run]") {
  const TemporaryFolder here;
  write_faulty("clean", {}, SyntheticMotionKind::kWalk, 12);
  write_faulty("invented", {.revealed = 1}, SyntheticMotionKind::kWalk, 12);
  const double clean = camera_error("clean", "unoccluded", "a"),
               remembers = camera_error("invented", "unoccluded", "b"),
               forgets = camera_error("invented", "background", "c");
  WARN("camera without invented content " << clean << " cm; with it " << remembers
                                          << " cm by the masks of all frames so far, " << forgets
                                          << " cm by those of the frame");
  CHECK(remembers < 1.5 * clean + 0.1);
  CHECK(forgets > 5 * remembers);
}

TEST_CASE("hands that vanish for some frames leave the body where it is", "[run]") {
  const TemporaryFolder here;
  write_faulty("clean", {}, SyntheticMotionKind::kWave, 7);
  write_faulty("vanishing", {.hands_fade = 1}, SyntheticMotionKind::kWave, 7);
  const std::vector<std::string> more = {"stages.interaction.iterations=40"};
  const RunSummary clean = execute_tiny(config_in("clean", more), "a"),
                   vanishing = execute_tiny(config_in("vanishing", more), "b");
  const double seen = last_number(clean, "world_mpjpe_mm"), unseen = last_number(vanishing, "world_mpjpe_mm");
  WARN("world MPJPE " << seen << " mm with hands, " << unseen << " mm where they vanish");
  CHECK(unseen < 1.2 * seen);
  const double drop = last_number(clean, "psnr_foreground_db") - last_number(vanishing, "psnr_foreground_db");
  CHECK(drop > 0.05);  // the hands are gone from the video, and not from the avatar
}

}  // namespace faults_test
