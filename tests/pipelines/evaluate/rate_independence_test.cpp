// What is measured of a motion does not depend on how many frames a second it has.
#include <cmath>
#include <numbers>

#include <catch2/catch.hpp>

#include "body/kinematics.h"
#include "body/motion_edit.h"
#include "body/procedural_body.h"
#include "pipelines/evaluate/tracks.h"
#include "pipelines/metrics/contact_metrics.h"
#include "pipelines/metrics/sequence_errors.h"

namespace rate_independence_test {

using namespace hsi4d;

namespace {

constexpr double kSeconds = 4;

/// A smooth motion: the body sways, swings its arms and slides along x at about 0.2 m/s; a box is at its left wrist for
/// the first half, then far away.
/// @param strength  of the sway
Track swaying(double rate, double strength) {
  Track track;
  track.name = "swaying";
  track.motion.frame_rate = rate;
  track.objects = {"box"};
  const BodyModel body = procedural_body();
  const auto wrist = static_cast<std::size_t>(3 * smplx_joint("left_wrist"));
  const auto frames = static_cast<int>(std::lround(kSeconds * rate)) + 1;
  for (int k = 0; k < frames; ++k) {
    const double t = k / rate, phase = std::numbers::pi * t;
    BodyPose pose = rest_pose(kSmplxJoints);
    pose.set_rotation(0, Vector3<double>(std::numbers::pi / 2, 0, 0));
    pose.set_rotation(16, Vector3<double>(0, 0, strength * std::sin(phase)));
    pose.set_rotation(17, Vector3<double>(0, 0, -strength * std::cos(0.7 * phase)));
    pose.set_rotation(3, Vector3<double>(0.2 * strength * std::sin(0.5 * phase), 0, 0));
    pose.transl = {0.2 * t + 0.02 * strength * std::sin(phase), 0, 1};
    track.motion.poses.push_back(pose);
    const Vector3<double> far(0, 0, t <= kSeconds / 2 ? 0 : 9);
    const std::vector<double> joints = pose_joints(body, pose);
    track.object_poses.push_back({{{0, 0, t}, Vector3<double>(joints.data() + wrist) + far}});
  }
  return track;
}

/// All that is measured at a rate, of a motion that was made at 120 frames a second and thinned out.
MetricValues measured(double rate) {
  const BodyModel body = procedural_body();
  const RestSkeleton skeleton{body.parents, body.joints};
  const AlignedTracks tracks = aligned(swaying(120, 0.5), skeleton, swaying(120, 0.4), skeleton, rate);
  MetricValues values = sequence_summary(tracks.estimate, tracks.truth, tracks.frame_rate);
  std::vector<std::vector<double>> joints;
  for (const FrameState& state : tracks.estimate) joints.push_back(state.joints);
  const MetricValues sliding = mean_after_first(sliding_by_frame(joints, tracks.frame_rate));
  values.insert(values.end(), sliding.begin(), sliding.end());
  Gaussians box;
  box.means = {0, 0, 0};
  box.opacity_logits = {0};
  const MetricValues contact = mean_after_first(contact_share_by_frame(joints, {&box}, tracks.states));
  values.insert(values.end(), contact.begin(), contact.end());
  return values;
}

}  // namespace

TEST_CASE("metrics of one motion at 10 30 60 and 120 frames a second are alike") {
  const MetricValues expected = measured(120);
  for (const char* name : {"mpjpe_mm", "pa_mpjpe_mm", "world_mpjpe_mm", "root_translation_mm", "foot_sliding_mm",
                           "jitter", "acceleration_error", "contact_share", "object_rotation_deg"})
    REQUIRE(find_metric(expected, name) != nullptr);
  CHECK(*find_metric(expected, "jitter") > 0.5);
  CHECK(*find_metric(expected, "acceleration_error") > 0.03);
  CHECK(*find_metric(expected, "foot_sliding_mm") == Approx(20).epsilon(0.1));
  CHECK(*find_metric(expected, "contact_share") == Approx(0.5));
  for (const double rate : {10.0, 30.0, 60.0}) {
    for (const auto& [name, value] : measured(rate)) {
      INFO(name << " at " << rate);
      CHECK(value == Approx(*find_metric(expected, name)).epsilon(0.05).margin(1e-9));
    }
  }
}

TEST_CASE("thresholds are the same at any rate, next to them on either side") {
  constexpr double kRates[] = {10, 12.5, 30, 60, 120};
  for (const double rate : kRates) {
    INFO(rate);
    // Both feet slide for two seconds at so many metres a second, and so high above where they were.
    const auto sliding = [rate](double speed, double height) {
      std::vector<std::vector<double>> joints;
      for (int k = 0; k <= static_cast<int>(2 * rate); ++k) {
        joints.emplace_back(66, 0.0);
        for (const char* name : {"left_ankle", "right_ankle", "left_foot", "right_foot"}) {
          double* const foot = joints.back().data() + 3 * smplx_joint(name);
          foot[0] = speed * k / rate;
          foot[2] = k == 0 ? 0 : height;
        }
      }
      return mean_after_first(sliding_by_frame(joints, rate));
    };
    CHECK(sliding(0.501, 0).empty());
    CHECK(sliding(0.499, 0).at(0).second == Approx(49.9));
    CHECK(sliding(0.2, 0.051).empty());
    // At 10 frames a second or more the way up to 4 mm is no step that is too fast.
    CHECK(sliding(0.2, 0.004).at(0).second == Approx(20));
    // A hand that nears a box by 0.1 m/s for two seconds: nearer than 5 cm in the last half second.
    std::vector<std::vector<double>> hands;
    std::vector<SceneState> states(static_cast<std::size_t>(2 * rate) + 1);
    for (std::size_t k = 0; k < states.size(); ++k) {
      hands.emplace_back(66, 9.0);
      double* const wrist = hands.back().data() + 3 * smplx_joint("left_wrist");
      wrist[0] = wrist[1] = 0;
      wrist[2] = 0.2 - 0.1 * static_cast<double>(k) / rate;
      states[k].objects.resize(1);
    }
    Gaussians box;
    box.means = {0, 0, 0};
    box.opacity_logits = {0};
    const MetricValues contact = mean_after_first(contact_share_by_frame(hands, {&box}, states));
    CHECK(*find_metric(contact, "contact_share") == Approx(0.25).margin(1 / (2 * rate)));
  }
}

TEST_CASE("a rate to measure at is that of the slower motion or below it") {
  const BodyModel body = procedural_body();
  const RestSkeleton skeleton{body.parents, body.joints};
  const Track fast = swaying(60, 0.5), slow = swaying(30, 0.4);
  CHECK(aligned(fast, skeleton, slow, skeleton).frame_rate == 30);
  const AlignedTracks tenth = aligned(fast, skeleton, slow, skeleton, 10);
  CHECK(tenth.frame_rate == 10);
  CHECK(tenth.estimate.size() == 41);
  CHECK(tenth.estimate[7].joints == pose_joints(body.parents, body.joints, fast.motion.poses[42]));
  CHECK_THROWS_WITH(aligned(fast, skeleton, slow, skeleton, 31),
                    "--frame-rate: 31 is above the 30 frames a second of swaying or swaying, and what is between "
                    "frames is not known; allowed: up to 30");
  const AlignedTracks alone = by_itself(fast, skeleton, 20);
  CHECK(alone.truth.empty());
  CHECK(alone.estimate.size() == 81);
  CHECK(alone.states[3].body.transl == fast.motion.poses[9].transl);
  CHECK(alone.states[3].objects[0].translation == fast.object_poses[9][0].translation);
  Track silent = fast;
  silent.motion.says_frame_rate = false;
  CHECK_THROWS_WITH(by_itself(silent, skeleton), "swaying: says no frame rate; --from-rate says it");
  silent.motion.says_frame_rate = true;
  silent.motion.poses.resize(1);
  CHECK_THROWS_WITH(by_itself(silent, skeleton),
                    "swaying: has 1 frames; what is measured is of the frames after the first");
}

}  // namespace rate_independence_test
