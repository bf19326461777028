// Gates of the background: videos that are shifted, or painted anew, after they were drawn.
#include <catch2/catch.hpp>

#include "core/image_io.h"
#include "pipelines/metrics/quality.h"
#include "tests/support/tiny_run.h"

namespace background_run_test {

using namespace hsi4d;
using namespace hsi4d::test;
namespace fs = std::filesystem;

namespace {

/// Draws the frames after the first anew, by what change(frame) makes of them.
template <class F>
void change_frames(const F& change) {
  for (const auto& entry : fs::directory_iterator("data/frames")) {
    if (entry.path().filename() == "0000.png") continue;
    const Image frame = read_image(entry.path().string());
    write_image(entry.path().string(), change(frame));
  }
}

/// A clip of a standing camera that a run does not follow.
RunSummary summary_of(const std::string& out) {
  const RunConfig config =
      load_run_config("data/config.json", {"stages.interaction.iterations=1"}, descriptions_of(loss_terms()));
  return execute_tiny(config, out);
}

std::string word(const RunSummary& summary, const std::string& metric) {
  for (const QualityGate& gate : summary.quality) {
    if (gate.metric == metric) return std::string(word_of(gate));
  }
  return "none";
}

void write_standing() {
  SyntheticSettings settings = TinyDataset::settings();
  settings.frames = 2;
  settings.size_px = 128;
  settings.scene_gaussians = 4000;
  settings.avatar_gaussians = 1500;
  settings.camera_drift = 0;
  ConfigProblems problems;
  ConfigValue stages =
      load_config_text(kTinyStages, "tiny.json", fs::current_path(),
                       {"stages.camera.iterations=1", "stages.camera.optimize.camera.lr=1e-9"}, problems);
  problems.throw_if_any();
  write_dataset(settings, video_render_settings(), "data", {}, stages);
}

}  // namespace

TEST_CASE("a background that stands where it was passes, one that is displaced does not", "[run]") {
  const TemporaryFolder here;
  write_standing();
  const RunSummary as_filmed = summary_of("filmed");
  CHECK(number_in(as_filmed.metrics.back().values, "camera_drift_px") < 0.2);
  CHECK(number_in(as_filmed.metrics.back().values, "background_change") < 0.01);
  CHECK(word(as_filmed, "camera_drift_px") == "pass");
  CHECK(word(as_filmed, "background_change") == "pass");

  constexpr int kRight = 2;
  change_frames([](const Image& frame) {
    Image moved = frame;
    for (int c = 0; c < frame.channels(); ++c) {
      for (int y = 0; y < frame.height(); ++y)
        std::copy_n(frame.row(c, y), frame.width() - kRight, moved.row(c, y) + kRight);
    }
    return moved;
  });
  const RunSummary shifted = summary_of("shifted");
  CHECK(number_in(shifted.metrics.back().values, "camera_drift_px") == Approx(kRight).margin(0.2));
  CHECK(word(shifted, "camera_drift_px") == "check");
  CHECK(word(shifted, "background_change") == "pass");
}

TEST_CASE("a background that a model has painted anew is told", "[run]") {
  const TemporaryFolder here;
  write_standing();
  constexpr int kSide = 64;  // a quarter of the picture
  change_frames([](const Image& frame) {
    Image painted = frame;
    for (int c = 0; c < frame.channels(); ++c) {
      for (int y = 0; y < kSide; ++y) {
        for (int x = 0; x < kSide; ++x) painted(c, y, x) = frame(c, y, x) < 0.5F ? 0.95F : 0.05F;
      }
    }
    return painted;
  });
  const RunSummary painted = summary_of("painted");
  const double share = number_in(painted.metrics.back().values, "background_change");
  CHECK(share > 0.1);
  CHECK(share < 0.4);
  CHECK(word(painted, "background_change") == "fail");
}

}  // namespace background_run_test
