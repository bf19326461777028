// The pixel filter that frame 0 says.
#include "pipelines/run/pixel_filter.h"

#include <set>

#include <catch2/catch.hpp>

#include "core/image_io.h"
#include "pipelines/config/run_problems.h"
#include "pipelines/run/reconstruct_stage.h"
#include "tests/support/tiny_run.h"

namespace pixel_filter_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
namespace fs = std::filesystem;

namespace {

Clip clip_of(const RunConfig& config) { return read_run_clip(config, loss_terms()); }

/// The tiny clip whose frame 0 is drawn with that filter.
RunConfig filmed_with(double blur) {
  RunConfig config = tiny_config();
  const Clip clip = clip_of(config);
  config.render.blur = blur;
  const Image frame = render_state(config, clip, clip.first, {});
  fs::remove_all("frames");
  fs::copy(config.data.frames, "frames");
  std::set<fs::path> files;
  for (const auto& entry : fs::directory_iterator("frames")) files.insert(entry.path());
  write_image(files.begin()->string(), frame);
  return tiny_config({"data.frames=" + fs::absolute("frames").string(), "render.blur=estimate"});
}

}  // namespace

TEST_CASE("the filter that a clip was filmed with is found by its frame 0") {
  const TemporaryFolder here;
  for (const double blur : {0.01, 0.05, 0.13, 0.36, 1.0}) {
    const RunConfig config = filmed_with(blur);
    INFO("filmed with " << blur);
    const PixelFilter filter = estimated_pixel_filter(config, clip_of(config));
    CHECK(filter.blur == Approx(blur).margin(0.004));
    CHECK(filter.psnr_db > 45);  // but for its eight bits
    CHECK_FALSE(filter.is_widest);
  }
}

TEST_CASE("a filter wider than any that is looked for is told and not used, without masks the whole image counts") {
  const TemporaryFolder here;
  const RunConfig wide = filmed_with(9);
  CHECK(estimated_pixel_filter(wide, clip_of(wide)).is_widest);
  CHECK_THROWS(execute_tiny(wide, "run", 1, false, [] { return true; }));
  CHECK_THAT(file_text("run/log.txt"), Contains("it tells no filter") && Contains("Used: 0.3 px^2"));
  RunConfig unseen = filmed_with(0.2);
  unseen.data.mask_threshold = 2;
  CHECK(estimated_pixel_filter(unseen, clip_of(unseen)).blur == Approx(0.2).margin(0.004));
}

TEST_CASE("a run with the estimate is the run with its number, and says so", "[run]") {
  const TemporaryFolder here;
  const RunConfig config = tiny_config({"render.blur=estimate"});
  const PixelFilter filter = estimated_pixel_filter(config, clip_of(config));
  execute_tiny(config, "estimated");
  execute_tiny(tiny_config({"render.blur=" + std::to_string(filter.blur)}), "told");
  CHECK(file_text("estimated/motion.npz") == file_text("told/motion.npz"));
  CHECK(file_text("estimated/objects.npz") == file_text("told/objects.npz"));
  CHECK_THAT(file_text("estimated/log.txt"), Contains("render.blur estimated from frame 0: 0."));
  CHECK(json_of("estimated/config.resolved.json")["render"]["blur"] == "estimate");
}

TEST_CASE("an estimate of the filter needs frame 0, and other words are refused") {
  CHECK_THROWS_WITH(tiny_config({"render.blur=guess"}),
                    Contains("/render/blur: guess is not a number; allowed: 0 to 100, or \"estimate\""));
  CHECK_THROWS_WITH(tiny_config({"render.blur=101"}), Contains("allowed: 0 to 100"));
  RunConfig config = tiny_config({"render.blur=estimate", "stages.camera.over=first_frame"});
  const std::vector<RunProblem> problems = run_problems(config, ConfigUse::kStages);
  REQUIRE(problems.size() == 1);
  CHECK(problems[0].pointer == "/render/blur");
  CHECK(problems[0].text ==
        "\"estimate\" looks at frame 0 as it is given, which stage \"camera\" has yet to find; "
        "allowed: a number");
}

}  // namespace pixel_filter_test
