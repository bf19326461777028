#include "pipelines/evaluate/tracks.h"

#include <cmath>

#include <catch2/catch.hpp>

#include "body/kinematics.h"
#include "body/procedural_body.h"
#include "core/check.h"
#include "core/rotation.h"
#include "tests/support/small_clip.h"

namespace tracks_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

/// A body that walks along x at 1 m/s and turns at 1 rad/s, an object at its side, a camera that goes along.
Track moving_track(double rate, Index frames, double shift = 0) {
  Track track;
  track.name = "moving";
  track.motion.frame_rate = rate;
  track.objects = {"box"};
  for (Index k = 0; k < frames; ++k) {
    const double t = static_cast<double>(k) / rate;
    BodyPose pose = rest_pose(kSmplxJoints);
    pose.set_rotation(0, Vector3<double>(0, 0, t));
    pose.transl = {t + shift, 0, 1};
    track.motion.poses.push_back(pose);
    track.object_poses.push_back({{{0, 0, t}, {t, 0.5 + shift, 1}}});
    track.camera_from_world.push_back(inverse(Rigid<double>{so3_exp(Vector3<double>(0, 0, t)), {t, -3, 1 + shift}}));
  }
  return track;
}

RestSkeleton skeleton() {
  const BodyModel body = procedural_body();
  return {body.parents, body.joints};
}

}  // namespace

TEST_CASE("tracks of the same rate are compared frame by frame, bit for bit") {
  const Track track = moving_track(10, 6), truth = moving_track(10, 8, 0.25);
  const RestSkeleton body = skeleton();
  const AlignedTracks both = aligned(track, body, truth, body);
  CHECK(both.frame_rate == 10);
  REQUIRE(both.estimate.size() == 6);  // as long as both last
  REQUIRE(both.truth.size() == 6);
  for (std::size_t t = 0; t < 6; ++t) {
    CHECK(both.estimate[t].joints == pose_joints(body.parents, body.joints, track.motion.poses[t]));
    CHECK(both.truth[t].world_from_object[0].translation == truth.object_poses[t][0].translation);
    CHECK(both.truth[t].camera_from_world->translation == truth.camera_from_world[t].translation);
  }
  const MetricValues errors = sequence_summary(both.estimate, both.truth, both.frame_rate);
  CHECK(*find_metric(errors, "world_mpjpe_mm") == Approx(250));
  CHECK(*find_metric(errors, "mpjpe_mm") == Approx(0).margin(1e-9));
  CHECK(*find_metric(errors, "object_translation_cm") == Approx(25));
  CHECK(*find_metric(errors, "camera_translation_cm") == Approx(25));
}

TEST_CASE("tracks of different rates are compared at the moments of the slower one") {
  // What moves evenly is between two frames where it would have been.
  const RestSkeleton body = skeleton();
  for (const auto& [fast, slow] : {std::pair{30.0, 10.0}, {25.0, 10.0}, {29.97, 12.5}}) {
    INFO(fast << " against " << slow);
    const Track dense = moving_track(fast, 31), sparse = moving_track(slow, 12);
    for (const bool is_estimate_dense : {true, false}) {
      const AlignedTracks both =
          is_estimate_dense ? aligned(dense, body, sparse, body) : aligned(sparse, body, dense, body);
      CHECK(both.frame_rate == slow);
      CHECK(std::ssize(both.truth) == std::min<Index>(12, static_cast<Index>(30 / fast * slow + 1e-9) + 1));
      const std::vector<FrameMetrics> errors = sequence_errors(both.estimate, both.truth, both.frame_rate);
      for (const auto& [name, value] : errors.back().values) {
        INFO(name);
        CHECK(value < (name == "camera_translation_cm" || name.ends_with("mm") ? 1e-6 : 1e-5));
      }
    }
  }
}

TEST_CASE("a track that begins later is compared from where it begins") {
  const RestSkeleton body = skeleton();
  const Track truth = moving_track(10, 8);
  Track late = moving_track(10, 8);
  late.motion.poses.erase(late.motion.poses.begin(), late.motion.poses.begin() + 3);
  late.object_poses.erase(late.object_poses.begin(), late.object_poses.begin() + 3);
  late.camera_from_world.clear();
  late.motion.first_frame = 3;
  for (const bool is_estimate : {true, false}) {
    const AlignedTracks both = is_estimate ? aligned(late, body, truth, body) : aligned(truth, body, late, body);
    CHECK(both.first == 3);
    REQUIRE(both.truth.size() == 5);
    CHECK(both.estimate[0].joints == pose_joints(body.parents, body.joints, truth.motion.poses[3]));
    const MetricValues errors = sequence_summary(both.estimate, both.truth, both.frame_rate);
    CHECK(*find_metric(errors, "world_mpjpe_mm") == 0);
  }
  CHECK(body_at(late, 0.35).transl[0] == Approx(0.35));
  late.motion.first_frame = 7;
  CHECK_THROWS_AS(aligned(late, body, truth, body), UserError);
}

TEST_CASE("what one of two tracks does not have is not measured") {
  const Track truth = moving_track(10, 5);
  Track track = moving_track(10, 5);
  const RestSkeleton body = skeleton();
  track.camera_from_world.clear();
  track.object_poses.clear();
  const auto names_of = [&](const Track& estimate, const Track& of) {
    const AlignedTracks both = aligned(estimate, body, of, body);
    std::vector<std::string> names;
    for (const auto& [name, value] : sequence_summary(both.estimate, both.truth, 10)) names.push_back(name);
    return names;
  };
  using Names = std::vector<std::string>;
  const Names of_body = {"mpjpe_mm",           "pa_mpjpe_mm", "world_mpjpe_mm", "root_translation_mm",
                         "acceleration_error", "jitter"};
  CHECK(names_of(track, truth) == Names{"mpjpe_mm", "pa_mpjpe_mm", "world_mpjpe_mm", "world_mpjpe_image_mm",
                                        "world_mpjpe_depth_mm", "root_translation_mm", "acceleration_error", "jitter"});
  CHECK(names_of(truth, track) == of_body);
  CHECK(names_of(track, track) == of_body);

  Track other = truth;
  other.objects = {"can"};
  CHECK_THROWS_WITH(aligned(other, body, truth, body),
                    "moving: there is no object \"box\", which moving has; there is can");
}

TEST_CASE("rates and lengths that cannot be compared are told") {
  const RestSkeleton body = skeleton();
  const Track truth = moving_track(10, 5);
  Track track = moving_track(25, 5);
  track.name = "silent";
  track.motion.says_frame_rate = false;
  CHECK(aligned(track, body, truth, body).frame_rate == 10);  // as many frames: those of the truth
  track.motion.poses.pop_back();
  CHECK_THROWS_WITH(aligned(track, body, truth, body),
                    "silent: says no frame rate, and has 4 frames where moving has 5; --from-rate says it");
  track.motion.says_frame_rate = true;
  track.motion.poses.resize(2);
  CHECK_THROWS_WITH(aligned(track, body, truth, body),
                    "silent: has 2 frames and moving 5; errors are those of the frames after the first that both have");
  Track hand = truth;
  for (BodyPose& pose : hand.motion.poses) pose = rest_pose(22);
  CHECK_THROWS_WITH(aligned(hand, body, truth, body), "moving: its poses have 22 joints, the body 55");
}

}  // namespace tracks_test
