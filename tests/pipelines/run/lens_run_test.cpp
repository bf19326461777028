// Clips that were filmed through a lens that bends.
#include <catch2/catch.hpp>

#include "core/image_io.h"
#include "core/lens.h"
#include "core/parallel.h"
#include "pipelines/config/run_problems.h"
#include "pipelines/input/keypoints.h"
#include "pipelines/run/lens_estimate.h"
#include "tests/support/tiny_run.h"

namespace lens_run_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
namespace fs = std::filesystem;

namespace {

/// A picture as the lens would have taken it: each of its pixels shows a direction of the pinhole's.
Image bent_picture(const Image& straight, const Camera& camera, const Lens& lens) {
  Image bent(straight.channels(), straight.height(), straight.width());
  for (int y = 0; y < bent.height(); ++y) {
    for (int x = 0; x < bent.width(); ++x) {
      const Vector2<double> at =
          straight_of(lens, {(x + 0.5 - camera.cx) / camera.fx, (y + 0.5 - camera.cy) / camera.fy});
      const double u = camera.fx * at[0] + camera.cx - 0.5, v = camera.fy * at[1] + camera.cy - 0.5;
      const int left = std::clamp(static_cast<int>(std::floor(u)), 0, bent.width() - 2);
      const int top = std::clamp(static_cast<int>(std::floor(v)), 0, bent.height() - 2);
      const auto a = static_cast<float>(std::clamp(u - left, 0.0, 1.0)),
                 b = static_cast<float>(std::clamp(v - top, 0.0, 1.0));
      for (int c = 0; c < bent.channels(); ++c) {
        bent(c, y, x) = (1 - b) * ((1 - a) * straight(c, top, left) + a * straight(c, top, left + 1)) +
                        b * ((1 - a) * straight(c, top + 1, left) + a * straight(c, top + 1, left + 1));
      }
    }
  }
  return bent;
}

/// A dataset of two frames, its frames and masks taken through a lens.
fs::path dataset_through(const Lens& lens) {
  SyntheticSettings settings = TinyDataset::settings();
  settings.frames = 2;
  settings.size_px = 128;
  settings.scene_gaussians = 4000;
  settings.avatar_gaussians = 1500;
  ConfigProblems problems;
  const ConfigValue stages = load_config_text(kTinyStages, "tiny.json", fs::current_path(), {}, problems);
  write_dataset(settings, video_render_settings(), "data", {}, stages);
  const Camera camera = read_clip(dataset_inputs("data")).camera;
  for (const char* folder : {"data/frames", "data/masks"}) {
    for (const auto& entry : fs::recursive_directory_iterator(folder)) {
      if (entry.path().extension() != ".png") continue;
      write_image(entry.path().string(), bent_picture(read_image(entry.path().string()), camera, lens));
    }
  }
  return fs::absolute("data");
}

double number_after(const RunConfig& config, const std::string& run, const char* metric) {
  return number_in(execute_tiny(config, run).metrics.back().values, metric);
}

}  // namespace

TEST_CASE("how much a lens bends is found by frame 0, and what it filmed is straightened", "[run]") {
  const TemporaryFolder here;
  const double k1 = GENERATE(-0.22, 0.13);
  const fs::path dataset = dataset_through({.k1 = k1});
  const RunConfig guessing = config_in(dataset, {"data.lens.k1=estimate"});
  const Clip clip = read_run_clip(guessing, loss_terms());
  LensEstimate found;
  for (const int threads : {1, 3}) {
    const LensEstimate before = found;
    with_threads(threads, [&] { found = estimated_lens(guessing, clip); });
    CHECK(found.k1 == Approx(k1).margin(0.01));
    CHECK_FALSE(found.is_widest);
    if (threads > 1) CHECK((found.k1 == before.k1 && found.psnr_db == before.psnr_db));
  }
  const double bent = number_after(config_in(dataset, {}), "bent", "psnr_db");
  const double known = number_after(config_in(dataset, {"data.lens.k1=" + std::to_string(k1)}), "known", "psnr_db");
  CHECK(known > bent + 2);
  CHECK(number_after(guessing, "guessed", "psnr_db") > bent + 2);
  CHECK_THAT(file_text("guessed/log.txt"), Contains("data.lens.k1 estimated from frame 0: "));
  const ClipFrame frame = read_frame(read_run_clip(config_in(dataset, {"data.lens.k1=0.3"}), loss_terms()), 0);
  CHECK(frame.seen(0, 0, 0) == 0);
  CHECK(frame.seen(0, 64, 64) == 1);
  CHECK(read_frame(read_run_clip(config_in(dataset, {}), loss_terms()), 0).seen.empty());
}

TEST_CASE("keypoints are straightened as the frames are") {
  const TemporaryFolder here;
  const RunConfig config = tiny_config();
  Clip clip = read_clip(config.data);
  const Camera& camera = clip.camera;
  const Lens lens{.k1 = -0.2, .p1 = 0.01};
  const Vector2<double> direction(0.2, -0.15), bent = bent_by(lens, direction);
  const auto share = [&camera](const Vector2<double>& at) {
    return Vector2<double>((camera.fx * at[0] + camera.cx) / camera.width,
                           (camera.fy * at[1] + camera.cy) / camera.height);
  };
  clip.keypoints = Keypoints{{{{0, 1.0}}}, {{{share(bent)[0], share(bent)[1], 0.9}}}, {}};
  set_lens(lens, clip);
  CHECK(clip.keypoints->frames[0][0].x == Approx(share(direction)[0]).epsilon(1e-9));
  CHECK(clip.keypoints->frames[0][0].y == Approx(share(direction)[1]).epsilon(1e-9));
  CHECK(clip.keypoints->frames[0][0].confidence == 0.9);
}

TEST_CASE("an estimated lens needs frame 0 as it is given") {
  RunConfig config = tiny_config();
  config.data.lens.estimate_k1 = true;
  StageSettings stage = config.stages.front().second;
  stage.over = StageScope::kFirst;
  config.stages.insert(config.stages.begin(), {"first", stage});
  std::string text;
  for (const RunProblem& problem : run_problems(config, ConfigUse::kStages))
    text += problem.pointer + ": " + problem.text + "\n";
  CHECK_THAT(text,
             Contains("/data/lens/k1: \"estimate\" looks at frame 0 as it is given, which stage \"first\" has yet to "
                      "find; allowed: a number"));
}

}  // namespace lens_run_test
