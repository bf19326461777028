#include "pipelines/run/start_choice.h"

#include <catch2/catch.hpp>

#include "pipelines/config/run_problems.h"
#include "pipelines/run/frame_start.h"
#include "pipelines/run/reconstruct_stage.h"
#include "tests/support/small_clip.h"
#include "tests/support/tiny_run.h"

namespace start_choice_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;

namespace {

/// Body and objects go to the right, 4 and 8 cm a frame.
SceneState moved(const Clip& clip, double t) {
  SceneState state = clip.first;
  state.body.transl[0] += 0.04 * t;
  for (ObjectPose& pose : state.objects) pose.translation[0] += 0.08 * t;
  return state;
}

/// A clip whose frames 0 and 1 are done, with estimates of frame 2 that stand `body` and `objects` frames on.
struct ThirdFrame {
  Clip clip = small_clip(64, 56, 400);
  RunConfig config;
  std::vector<SceneState> done;

  ThirdFrame(double body, double objects) : done{moved(clip, 0), moved(clip, 1)} {
    for (int t = 0; t < 3; ++t) {
      clip.estimate.push_back(moved(clip, body).body);
      clip.object_estimate.push_back(moved(clip, objects).objects);
    }
    config.start = {StartFrom::kPrevious, StartFrom::kBest, StartFrom::kBest, StartFrom::kPrevious};
  }

  /// What is chosen where the frame shows the body and the objects so many frames on.
  ChosenStart choice(double body, double objects) const {
    SceneState shown = moved(clip, body);
    shown.objects = moved(clip, objects).objects;
    ClipFrame frame;
    frame.target = render_state(config, clip, shown, {});
    return choose_start(config, clip, done, frame, frame_start(config.start, clip, done), {});
  }
};

double body_place(const Clip& clip, const ChosenStart& chosen) {
  return (chosen.state.body.transl[0] - clip.first.body.transl[0]) / 0.04;
}
double object_place(const Clip& clip, const ChosenStart& chosen) {
  return (chosen.state.objects[1].translation[0] - clip.first.objects[1].translation[0]) / 0.08;
}

}  // namespace

TEST_CASE("the best start is the one whose image is nearest to the frame's, of body and objects apart") {
  const ThirdFrame frame(4, 5);
  // Where the frame before ended (1), going on (2), as estimated (4 and 5).
  for (const double body : {1.0, 2.0, 4.0}) {
    for (const double objects : {1.0, 2.0, 5.0}) {
      INFO("the frame shows the body at " << body << ", the objects at " << objects);
      const ChosenStart chosen = frame.choice(body, objects);
      CHECK(body_place(frame.clip, chosen) == Approx(body).epsilon(1e-9));
      CHECK(object_place(frame.clip, chosen) == Approx(objects).epsilon(1e-9));
      const std::string of_body = body == 1 ? "previous" : body == 2 ? "velocity" : "estimate";
      const std::string of_objects = objects == 1 ? "previous" : objects == 2 ? "velocity" : "estimate";
      CHECK(start_text(chosen) == "root " + of_body + ", objects " + of_objects);
    }
  }
}

TEST_CASE("choices of starts are counted by part, and parts that were never chosen are left out") {
  const ThirdFrame frame(4, 5);
  StartTotals totals;
  CHECK(summarize_start(totals).parts.empty());
  for (const double objects : {1.0, 2.0, 2.0}) totals.add(frame.choice(4, objects));
  totals.seconds = 0.5;
  const StartSummary summary = summarize_start(totals);
  CHECK(summary.seconds == 0.5);
  REQUIRE(summary.parts.size() == 2);
  using Counts = std::vector<std::pair<std::string, Index>>;
  CHECK(summary.parts[0].part == "root");
  CHECK(summary.parts[0].begun == Counts{{"previous", 0}, {"estimate", 3}, {"velocity", 0}});
  CHECK(summary.parts[1].part == "objects");
  CHECK(summary.parts[1].begun == Counts{{"previous", 1}, {"estimate", 0}, {"velocity", 2}});
}

TEST_CASE("parts that do not ask for the best start keep theirs, and a clip without estimates has two to choose from") {
  ThirdFrame frame(4, 5);
  frame.config.start.objects = StartFrom::kVelocity;
  CHECK(object_place(frame.clip, frame.choice(4, 5)) == Approx(2).epsilon(1e-9));
  CHECK(body_place(frame.clip, frame.choice(4, 5)) == Approx(4).epsilon(1e-9));
  frame.clip.estimate.clear();
  frame.clip.object_estimate.clear();
  CHECK(body_place(frame.clip, frame.choice(1, 2)) == Approx(1).epsilon(1e-9));
  CHECK_FALSE(chooses_start(StartSettings{}));
  CHECK(chooses_start(frame.config.start));
}

TEST_CASE("a run tells which starts it chose, resumed or not", "[run]") {
  const TemporaryFolder here;
  const RunConfig config = tiny_config(
      {"stages.camera.iterations=1", "stages.interaction.iterations=2", "start.root=best", "start.objects=best"});
  execute_tiny(config, "whole");
  const std::string log = file_text("whole/log.txt");
  for (int t = 1; t < kTinyFrames; ++t)
    CHECK_THAT(log, Contains("frame " + std::to_string(t) + ", start: root ") && Contains(", objects "));
  const nlohmann::json start = json_of("whole/summary.json")["start"];
  CHECK(start["seconds"].get<double>() > 0);
  CHECK_FALSE(start.contains("pose"));
  for (const char* part : {"root", "objects"}) {
    int frames = 0;
    for (const auto& [name, count] : start[part].items()) frames += count.get<int>();
    CHECK(frames == kTinyFrames - 1);
  }
  CHECK_THAT(file_text("whole/report.html"), Contains("</span>start</th><td>"));
  int count = 0;
  CHECK_THROWS_AS(execute_tiny(config, "run", 1, false, [&] { return ++count == 5; }), Interrupted);
  execute_tiny(config, "run", 2, true);
  CHECK(differences("whole", "run").empty());
  execute_tiny(tiny_config({"stages.camera.iterations=1", "stages.interaction.iterations=1"}), "plain");
  CHECK_FALSE(json_of("plain/summary.json").contains("start"));
}

TEST_CASE("a best start that no stage would choose is refused") {
  RunConfig config = tiny_config();
  config.stages.pop_back();  // the camera's alone is left
  config.start.objects = StartFrom::kBest;
  CHECK_THROWS_WITH(prepare_run(config),
                    "/start/objects: \"best\" is never chosen: it compares images of everything, and every stage over "
                    "frames has \"draw\": \"scene\"");
  config.start.objects = StartFrom::kVelocity;
  CHECK_NOTHROW(prepare_run(config));
}

}  // namespace start_choice_test
