#include "pipelines/run/frame_start.h"

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/rotation.h"
#include "tests/support/measures.h"
#include "tests/support/small_clip.h"

namespace frame_start_test {

using namespace hsi4d;
using test::small_clip;

namespace {

/// Everything goes on evenly: lines, and turns about fixed axes.
SceneState moving_state(const Clip& clip, double t) {
  SceneState state = clip.first;
  state.body.transl += t * Vector3<double>(0.1, 0.2, -0.05);
  for (Index j = 0; j < kSmplxJoints; ++j) state.body.set_rotation(j, t * Vector3<double>(0.05, 0.01, -0.1));
  for (ObjectPose& pose : state.objects) {
    pose.rotation = t * Vector3<double>(0, 0.3, 0.1);
    pose.translation += t * Vector3<double>(0, 0.1, 0.3);
  }
  state.camera_from_world = look_at(Vector3<double>(3 + 0.1 * t, -2, 1), Vector3<double>(0.1 * t, 0, 1));
  return state;
}

double distance(const SceneState& a, const SceneState& b) {
  double largest = (a.body.transl - b.body.transl).norm();
  for (Index j = 0; j < kSmplxJoints; ++j)
    largest = test::larger(largest, (so3_exp(a.body.rotation_of(j)) - so3_exp(b.body.rotation_of(j))).norm());
  for (std::size_t o = 0; o < a.objects.size(); ++o) {
    largest = test::larger(largest, (a.objects[o].translation - b.objects[o].translation).norm());
    largest = test::larger(largest, (so3_exp(a.objects[o].rotation) - so3_exp(b.objects[o].rotation)).norm());
  }
  largest = test::larger(largest, (a.camera_from_world.rotation - b.camera_from_world.rotation).norm());
  return test::larger(largest, (a.camera_from_world.translation - b.camera_from_world.translation).norm());
}

StartSettings all_from(StartFrom from) { return {from, from, from, from}; }

}  // namespace

TEST_CASE("with its velocity a frame begins where an even movement goes on") {
  const Clip clip = small_clip(16, 14, 100);
  std::vector<SceneState> done = {moving_state(clip, 0)};
  CHECK(distance(frame_start(all_from(StartFrom::kVelocity), clip, done), done[0]) == 0);  // it has none yet
  done.push_back(moving_state(clip, 1));
  CHECK(distance(frame_start(all_from(StartFrom::kVelocity), clip, done), moving_state(clip, 2)) < 1e-12);
  CHECK(distance(frame_start(all_from(StartFrom::kPrevious), clip, done), done[1]) == 0);
}

TEST_CASE("a frame begins as the method says, or with the estimates that are asked for") {
  Clip clip = small_clip(16, 14, 100);
  const std::vector<SceneState> done = {moving_state(clip, 0), moving_state(clip, 1)};
  const SceneState plain = frame_start({}, clip, done);
  CHECK(distance(plain, done[1]) == 0);  // no estimates
  for (int t = 0; t < 3; ++t) {
    SceneState estimate = moving_state(clip, 5 + t);
    clip.estimate.push_back(estimate.body);
    clip.object_estimate.push_back(estimate.objects);
  }
  SceneState expected = done[1];
  for (Index j = 1; j < kSmplxJoints; ++j) expected.body.set_rotation(j, clip.estimate[2].rotation_of(j));
  CHECK(distance(frame_start({}, clip, done), expected) == 0);
  StartSettings settings;
  settings.root = settings.objects = StartFrom::kEstimate;
  expected.body = clip.estimate[2];
  expected.objects = clip.object_estimate[2];
  CHECK(distance(frame_start(settings, clip, done), expected) == 0);
  CHECK_NOTHROW(check_start(settings, clip));
}

TEST_CASE("estimates that a clip does not have are told") {
  const Clip clip = small_clip(16, 14, 100);
  StartSettings settings;
  CHECK_NOTHROW(check_start(settings, clip));  // joints then begin as in the frame before
  settings.root = StartFrom::kEstimate;
  CHECK_THROWS_WITH(check_start(settings, clip),
                    "/start/root: \"estimate\": data.initial names a motion of frame 0 alone");
  settings.root = StartFrom::kPrevious;
  settings.objects = StartFrom::kEstimate;
  CHECK_THROWS_WITH(check_start(settings, clip), "/start/objects: \"estimate\": data.initial names no object_tracks");
}

}  // namespace frame_start_test
