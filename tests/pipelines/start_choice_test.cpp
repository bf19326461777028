#include "pipelines/start_choice.h"

#include <catch2/catch.hpp>

#include "pipelines/frame_start.h"
#include "pipelines/reconstruct_stage.h"
#include "tests/pipelines/small_clip.h"

using namespace hsi4d;
using test::small_clip;

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
  SceneState choice(double body, double objects) const {
    SceneState shown = moved(clip, body);
    shown.objects = moved(clip, objects).objects;
    ClipFrame frame;
    frame.target = render_state(config, clip, shown, {});
    return choose_start(config, clip, done, frame, frame_start(config.start, clip, done), {});
  }
};

double body_place(const Clip& clip, const SceneState& state) {
  return (state.body.transl[0] - clip.first.body.transl[0]) / 0.04;
}
double object_place(const Clip& clip, const SceneState& state) {
  return (state.objects[1].translation[0] - clip.first.objects[1].translation[0]) / 0.08;
}

}  // namespace

TEST_CASE("the best start is the one whose image is nearest to the frame's, of body and objects apart") {
  const ThirdFrame frame(4, 5);
  // Where the frame before ended (1), going on (2), as estimated (4 and 5).
  for (const double body : {1.0, 2.0, 4.0}) {
    for (const double objects : {1.0, 2.0, 5.0}) {
      INFO("the frame shows the body at " << body << ", the objects at " << objects);
      const SceneState chosen = frame.choice(body, objects);
      CHECK(body_place(frame.clip, chosen) == Approx(body).epsilon(1e-9));
      CHECK(object_place(frame.clip, chosen) == Approx(objects).epsilon(1e-9));
    }
  }
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
