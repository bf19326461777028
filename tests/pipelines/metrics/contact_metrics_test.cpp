#include "pipelines/metrics/contact_metrics.h"

#include <catch2/catch.hpp>

#include "body/body_model.h"
#include "body/kinematics.h"
#include "core/parallel.h"
#include "tests/support/small_clip.h"

namespace contact_metrics_test {

using namespace hsi4d;

namespace {

/// A body of five Gaussians, each on one joint: two on the right wrist, 1 and 4 cm from it along x, one on each of the
/// left wrist, the head and a finger of the right hand. In its rest pose, which is also that of all states.
struct Human {
  Avatar avatar = test::small_clip(16, 14, 20).avatar;
  Vector3<double> right_wrist, finger, left_wrist;

  Human() {
    const std::vector<double> joints = pose_joints(avatar, rest_pose(kSmplxJoints));
    const auto place = [&joints](const char* name) { return Vector3<double>(joints.data() + 3 * smplx_joint(name)); };
    right_wrist = place("right_wrist");
    left_wrist = place("left_wrist");
    finger = place("right_index1");
    avatar.means.clear();
    avatar.weights = {};
    avatar.weights.joints = kSmplxJoints;
    avatar.weights.per_vertex = 1;
    add("right_wrist", right_wrist + Vector3<double>(0.01, 0, 0));
    add("right_wrist", right_wrist + Vector3<double>(0.04, 0, 0));
    add("left_wrist", left_wrist);
    add("head", place("head"));
    add("right_index1", finger);
  }
  void add(const char* joint, const Vector3<double>& place) {
    for (int i = 0; i < 3; ++i) avatar.means.push_back(static_cast<float>(place[i]));
    avatar.weights.indices.push_back(static_cast<std::int32_t>(smplx_joint(joint)));
    avatar.weights.weights.push_back(1);
    ++avatar.weights.vertices;
  }
};

/// One Gaussian, at its object's place.
Gaussians one_gaussian() {
  Gaussians gaussians;
  gaussians.means = {0, 0, 0};
  gaussians.opacity_logits = {0};
  return gaussians;
}

SceneState state_with(const std::vector<Vector3<double>>& objects) {
  SceneState state;
  state.body = rest_pose(kSmplxJoints);
  for (const Vector3<double>& place : objects) state.objects.push_back({Vector3<double>::Zero(), place});
  return state;
}

}  // namespace

TEST_CASE("contact counts frames with a hand joint near an object, and how far the near Gaussians of hands are") {
  const Human human;
  const Gaussians object = one_gaussian();
  const Vector3<double> far(9, 9, 9), x(1, 0, 0);
  const std::vector<SceneState> states = {
      state_with({human.right_wrist, far}),              // distances 10 and 40 mm
      state_with({human.right_wrist - 0.02 * x, far}),   // 30 mm; the other, 60 mm, is no more near
      state_with({far, human.left_wrist + 0.049 * x}),   // the second object, the other hand: 49 mm
      state_with({human.right_wrist + 0.085 * x, far}),  // 45 mm of a Gaussian, but 85 mm of the joint
      state_with({far, far})};
  const auto values = contact_by_frame(human.avatar, {&object, &object}, states);
  REQUIRE(values.size() == 5);
  const std::vector<double> shares = {1, 1, 1, 0, 0}, distances = {25, 30, 49, 45};
  for (std::size_t t = 0; t < 5; ++t) {
    INFO("state " << t);
    const double* const share = find_metric(values[t], "contact_share");
    const double* const distance = find_metric(values[t], "contact_distance_mm");
    REQUIRE(share != nullptr);
    CHECK(*share == shares[t]);
    REQUIRE((distance != nullptr) == (t < 4));
    if (distance != nullptr) CHECK(*distance == Approx(distances[t]).epsilon(1e-4));
  }
  // Frame 0 is given; the last has no distance, and counts in the share alone.
  const MetricValues means = mean_after_first(values);
  CHECK(*find_metric(means, "contact_share") == 0.5);
  CHECK(*find_metric(means, "contact_distance_mm") == Approx((30 + 49 + 45) / 3.0).epsilon(1e-4));
}

TEST_CASE("a head near an object is no contact, and without objects there is none to speak of") {
  const Human human;
  const Gaussians object = one_gaussian();
  const std::vector<double> joints = pose_joints(human.avatar, rest_pose(kSmplxJoints));
  const Vector3<double> head(joints.data() + 3 * smplx_joint("head"));
  const auto values = contact_by_frame(human.avatar, {&object}, {state_with({head})});
  CHECK(values == std::vector<MetricValues>{{{"contact_share", 0.0}}});
  CHECK(contact_by_frame(human.avatar, {}, {state_with({})}) == std::vector<MetricValues>{{}});
}

TEST_CASE("contact has the same bits for any number of threads") {
  const Clip clip = test::small_clip(16, 14, 5000, 3000);
  const PosedJoints body = pose_skeleton(clip.avatar, clip.first.body);
  SceneState state = clip.first;
  for (std::size_t o = 0; o < 2; ++o)
    state.objects[o].translation = Vector3<double>(body.joints.data() + 3 * (20 + o)) + Vector3<double>(0.03, 0, 0);
  const auto values = [&](int threads) {
    std::vector<MetricValues> all;
    with_threads(threads, [&] {
      all = contact_by_frame(clip.avatar, {&clip.objects[0].gaussians, &clip.objects[1].gaussians}, {state});
    });
    return all;
  };
  const auto expected = values(1);
  REQUIRE(find_metric(expected[0], "contact_distance_mm") != nullptr);
  for (const int threads : {2, 3, 8}) CHECK(values(threads) == expected);
}

TEST_CASE("the floor drifts by the lowest foot") {
  std::vector<double> first(66, 1.0), up = first, one = first;
  for (const char* name : {"left_ankle", "right_ankle", "left_foot", "right_foot"}) {
    up[static_cast<std::size_t>(3 * smplx_joint(name) + 2)] = 1.03;
    one[static_cast<std::size_t>(3 * smplx_joint(name) + 2)] = std::string(name) == "right_foot" ? 0.98 : 1.5;
  }
  const auto values = floor_drift_by_frame({first, up, one, first});
  REQUIRE(values.size() == 4);
  CHECK(values[0].empty());
  CHECK(*find_metric(values[1], "floor_drift_mm") == Approx(30));
  CHECK(*find_metric(values[2], "floor_drift_mm") == Approx(20));
  CHECK(*find_metric(values[3], "floor_drift_mm") == 0);
}

TEST_CASE("sliding by frame is since the frame before, by the heights of frame 0") {
  std::vector<double> first(66, 0.0), second = first, third = first;
  for (const char* name : {"left_ankle", "right_ankle", "left_foot", "right_foot"}) {
    second[static_cast<std::size_t>(3 * smplx_joint(name))] = 0.02;
    third[static_cast<std::size_t>(3 * smplx_joint(name))] = 0.03;
  }
  std::vector<double> jump = third;
  for (const char* name : {"left_ankle", "right_ankle", "left_foot", "right_foot"})
    jump[static_cast<std::size_t>(3 * smplx_joint(name) + 2)] = 0.2;
  const auto values = sliding_by_frame({first, second, third, jump}, 10);
  REQUIRE(values.size() == 4);
  CHECK(values[0].empty());
  CHECK(*find_metric(values[1], "foot_sliding_mm") == Approx(20));
  CHECK(*find_metric(values[2], "foot_sliding_mm") == Approx(10));
  CHECK(values[3].empty());
  CHECK(*find_metric(mean_after_first(values), "foot_sliding_mm") == Approx(15));
}

}  // namespace contact_metrics_test
