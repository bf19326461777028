// Runs that are shown in TensorBoard.
#include <algorithm>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "tests/support/event_records.h"
#include "tests/support/tiny_run.h"

namespace events_run_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
namespace fs = std::filesystem;

namespace {

const std::vector<std::string> kNone;
const std::vector<std::string> kShown = {"log.tensorboard=true", "log.images_every=2"};

/// The stages of the tiny dataset, few iterations of them, between one over the first frame and one over the sequence.
RunConfig all_stages_config() {
  const TemporaryFolder here;
  nlohmann::json content = nlohmann::json::parse(R"({"stages": {
    "camera": {"iterations": 2}, "interaction": {"iterations": 3},
    "fit_first_camera": {
      "over": "first_frame", "iterations": 4, "draw": "scene", "weight": "unoccluded",
      "optimize": {"camera": {"lr": 0.004}}, "losses": {"masked_l2": {}}
    },
    "refinement": {
      "over": "sequence", "iterations": 5, "optimize": {"transl": {"lr": 0.002}},
      "losses": {"fit": {}, "smooth": {"weight": 0.05}}
    }}})");
  content["extends"] = tiny_config_file();
  here.write("all.json", content.dump());
  return load_run_config("all.json", kShown, descriptions_of(loss_terms()));
}

}  // namespace

TEST_CASE("a run shows its lines, images and metrics, and has the bits of one that shows nothing", "[run]") {
  const TemporaryFolder here;
  execute_tiny(tiny_config(), "plain");
  CHECK_FALSE(fs::exists("plain/tensorboard"));
  execute_tiny(tiny_config(kShown), "shown");
  CHECK(differences("plain", "shown") == std::vector<std::string>{"config.resolved.json"});
  const std::vector<std::string> events = events_of_run("shown");
  CHECK(count_tagged(events, "loss/camera") == 8 * (kTinyFrames - 1));
  CHECK(count_tagged(events, "loss_interaction/photometric") == 10 * (kTinyFrames - 1));
  CHECK(count_tagged(events, "frame_loss/interaction") == kTinyFrames - 1);
  CHECK(count_tagged(events, "result/psnr_db") == kTinyFrames - 1);
  CHECK(count_tagged(events, "mean/psnr_db") == 1);
  for (const char* const kind : {"target", "render", "difference"}) {
    CHECK(count_tagged(events, "images/" + std::string(kind)) == 1);  // of frame 2
    const std::string png = file_text("shown/frames/0002_" + std::string(kind) + ".png");
    CHECK(std::count_if(events.begin(), events.end(), [&](const auto& event) { return event.ends_with(png); }) == 1);
  }
}

TEST_CASE("a run that was stopped anywhere and resumed shows what one shows that never was", "[run]") {
  const TemporaryFolder here;
  const RunConfig config = all_stages_config();
  execute_tiny(config, "whole");
  const std::vector<std::string> whole = events_of_run("whole");
  CHECK(count_tagged(whole, "loss/refinement") == 5);
  CHECK(count_tagged(whole, "frame_loss/fit_first_camera") == 1);
  CHECK(count_tagged(whole, "frame_loss/refinement") == 0);
  CHECK(count_tagged(whole, "images/render") == 2);  // of frame 0, which a stage has found, and of frame 2, at the end
  // Within frame 0, within frame 2, in the refinement, and while the preview is drawn, when all is shown.
  constexpr int kInPreview = 4 + 3 * 5 + 5 + 3 + 1;
  for (const int last : {2, 4 + 5 + 2, 4 + 15 + 3, kInPreview}) {
    INFO("stopped after step " << last);
    const std::string run = "stopped" + std::to_string(last);
    int count = 0;
    CHECK_THROWS_AS(execute_tiny(config, run, 1, false, [&] { return ++count == last; }), Interrupted);
    CHECK((events_of_run(run) == whole) == (last == kInPreview));
    execute_tiny(config, run, 2, true);
    CHECK(events_of_run(run) == whole);
    CHECK(differences("whole", run) == kNone);
  }
}

TEST_CASE("a run is resumed with events or without them, whatever it had before", "[run]") {
  const TemporaryFolder here;
  int count = 0;
  CHECK_THROWS_AS(execute_tiny(tiny_config(kShown), "run", 1, false, [&] { return ++count == kPerFrame + 3; }),
                  Interrupted);
  CHECK(fs::exists("run/tensorboard"));
  count = 0;
  CHECK_THROWS_AS(execute_tiny(tiny_config(), "run", 1, true, [&] { return ++count == 3; }), Interrupted);
  CHECK_FALSE(fs::exists("run/tensorboard"));
  execute_tiny(tiny_config(kShown), "run", 1, true);
  execute_tiny(tiny_config(kShown), "whole");
  CHECK(events_of_run("run") == events_of_run("whole"));
  CHECK(differences("whole", "run") == kNone);
}

TEST_CASE("images without events are told to do nothing", "[run]") {
  const TemporaryFolder here;
  execute_tiny(tiny_config({"log.images_every=2", "stages.camera.iterations=1", "stages.interaction.iterations=1"}),
               "run");
  CHECK_THAT(file_text("run/log.txt"), Contains(" warning log.images_every does nothing without log.tensorboard\n"));
}

}  // namespace events_run_test
