#include "pipelines/synthetic/noise.h"

#include <cmath>
#include <numbers>

#include <catch2/catch.hpp>

#include "body/body_model.h"
#include "core/rotation.h"

namespace noise_test {

using namespace hsi4d;

namespace {

double degrees_between(const Matrix3<double>& a, const Matrix3<double>& b) {
  return so3_log(Matrix3<double>(a.transpose() * b)).norm() * 180 / std::numbers::pi;
}

/// How far a joint of a frame is off, degrees.
double off(const Motion& truth, const Motion& motion, std::size_t t, Index joint) {
  return degrees_between(so3_exp(truth.poses[t].rotation_of(joint)), so3_exp(motion.poses[t].rotation_of(joint)));
}

SyntheticSettings no_noise() {
  SyntheticSettings settings;
  settings.pose_noise_deg = settings.root_noise_deg = settings.root_noise_m = 0;
  return settings;
}

Motion standing(std::size_t frames) {
  Motion truth;
  truth.poses.assign(frames, rest_pose(kSmplxJoints));
  return truth;
}

/// A mask of a disc: 1 within `radius` of the middle.
Image disc(int size, double radius) {
  Image mask(1, size, size);
  for (int y = 0; y < size; ++y)
    for (int x = 0; x < size; ++x)
      mask(0, y, x) = std::hypot(x + 0.5 - size / 2.0, y + 0.5 - size / 2.0) < radius ? 1 : 0;
  return mask;
}

double area(const Image& mask) {
  double sum = 0;
  for (int y = 0; y < mask.height(); ++y)
    for (int x = 0; x < mask.width(); ++x) sum += double(mask(0, y, x));
  return sum;
}

}  // namespace

TEST_CASE("the initial motion is off by about what the settings say") {
  Motion truth;
  truth.poses.assign(200, rest_pose(kSmplxJoints));
  for (BodyPose& pose : truth.poses) pose.set_rotation(4, {0.5, 0.2, -0.1});
  SyntheticSettings settings;
  const Motion motion = disturbed_motion(truth, settings);
  const auto rms = [&](Index first, Index last) {
    double sum = 0;
    for (std::size_t t = 1; t < 200; ++t)
      for (Index joint = first; joint <= last; ++joint)
        sum += std::pow(
            degrees_between(so3_exp(truth.poses[t].rotation_of(joint)), so3_exp(motion.poses[t].rotation_of(joint))),
            2);
    return std::sqrt(sum / (199.0 * double(last - first + 1)));
  };
  CHECK(rms(1, 21) == Approx(8).epsilon(0.05));
  CHECK(rms(25, 54) == Approx(2).epsilon(0.05));
  CHECK(rms(0, 0) == Approx(2).epsilon(0.15));
  CHECK(rms(22, 24) == 0);
  settings.pose_noise_deg = settings.root_noise_deg = settings.root_noise_m = 0;
  const Motion same = disturbed_motion(truth, settings);
  for (std::size_t t = 0; t < 200; ++t) {
    CHECK(same.poses[t].axis_angle == truth.poses[t].axis_angle);
    CHECK(same.poses[t].transl == truth.poses[t].transl);
  }
}

TEST_CASE("a slow bias is alike in frames that follow each other and has the size asked for") {
  const Motion truth = standing(81);  // once around: 8 s
  SyntheticSettings settings = no_noise();
  settings.pose_bias_deg = 3;
  const Motion motion = disturbed_motion(truth, settings);
  double sum = 0, step = 0;
  for (std::size_t t = 1; t < 81; ++t)
    for (Index joint = 1; joint <= 21; ++joint) {
      sum += std::pow(off(truth, motion, t, joint), 2);
      if (t > 1)
        step = std::max(step, degrees_between(so3_exp(motion.poses[t].rotation_of(joint)),
                                              so3_exp(motion.poses[t - 1].rotation_of(joint))));
    }
  CHECK(std::sqrt(sum / (80.0 * 21)) == Approx(3).epsilon(0.2));
  CHECK(step < 0.8);
  CHECK(off(truth, motion, 0, 4) == 0);
  CHECK(off(truth, motion, 10, 0) == 0);
  CHECK(off(truth, motion, 10, 30) < off(truth, motion, 10, 4) + 3);
}

TEST_CASE("a drift grows to the size asked for") {
  const Motion truth = standing(41);
  SyntheticSettings settings = no_noise();
  settings.pose_drift_deg = 6;
  settings.root_drift_m = 0.2;
  const Motion motion = disturbed_motion(truth, settings);
  double sum = 0;
  for (Index joint = 1; joint <= 21; ++joint) {
    sum += std::pow(off(truth, motion, 40, joint), 2);
    CHECK(off(truth, motion, 20, joint) == Approx(off(truth, motion, 40, joint) / 2).margin(1e-6));
  }
  CHECK(std::sqrt(sum / 21) == Approx(6).epsilon(0.3));
  const Vector3<double> end = motion.poses[40].transl - truth.poses[40].transl;
  CHECK(end.norm() > 0.05);
  CHECK((2 * (motion.poses[20].transl - truth.poses[20].transl) - end).norm() < 1e-12);
}

TEST_CASE("poses of the object are off by about what the settings say and exact in frame 0") {
  std::vector<Rigid<double>> truth(400);
  for (Rigid<double>& pose : truth) pose = {so3_exp(Vector3<double>(0.3, -0.2, 1)), {1, 2, 3}};
  SyntheticSettings settings;
  settings.object_noise_deg = 10;
  settings.object_noise_m = 0.05;
  const auto poses = disturbed_object(truth, settings);
  double angle = 0, way = 0;
  for (std::size_t t = 1; t < 400; ++t) {
    angle += std::pow(degrees_between(truth[t].rotation, poses[t].rotation), 2);
    way += (poses[t].translation - truth[t].translation).squaredNorm() / 3;
  }
  CHECK(std::sqrt(angle / 399) == Approx(10).epsilon(0.08));
  CHECK(std::sqrt(way / 399) == Approx(0.05).epsilon(0.08));
  CHECK(poses[0].rotation == truth[0].rotation);
  CHECK(poses[0].translation == truth[0].translation);
}

TEST_CASE("masks grow and shrink by pixels, become jagged, and are dropped") {
  const Image mask = disc(96, 20);
  CHECK(disturbed_mask(mask, {}, 0, "human", 1) == mask);
  const double grown = area(disturbed_mask(mask, {.grow_px = 3}, 0, "human", 1));
  CHECK(grown == Approx(std::numbers::pi * 23 * 23).epsilon(0.03));
  const double eaten = area(disturbed_mask(mask, {.grow_px = -3}, 0, "human", 1));
  CHECK(eaten == Approx(std::numbers::pi * 17 * 17).epsilon(0.03));
  const Image jagged = disturbed_mask(mask, {.jagged_px = 5}, 0, "human", 1);
  double more = 0, less = 0;
  for (int y = 0; y < 96; ++y)
    for (int x = 0; x < 96; ++x) {
      more += std::max(0.0, double(jagged(0, y, x) - mask(0, y, x)));
      less += std::max(0.0, double(mask(0, y, x) - jagged(0, y, x)));
      if (std::abs(std::hypot(x - 47.5, y - 47.5) - 20) > 6) CHECK(jagged(0, y, x) == mask(0, y, x));
    }
  CHECK(more > 20);
  CHECK(less > 20);
  CHECK_FALSE(jagged == disturbed_mask(mask, {.jagged_px = 5}, 0, "human", 2));
  CHECK_FALSE(jagged == disturbed_mask(mask, {.jagged_px = 5}, 0, "vase", 1));
  int dropped = 0;
  for (Index t = 1; t <= 200; ++t)
    dropped += area(disturbed_mask(mask, {.dropped_share = 0.25}, 3, "human", t)) == 0 ? 1 : 0;
  CHECK(dropped > 30);
  CHECK(dropped < 70);
  CHECK(disturbed_mask(mask, {.dropped_share = 1}, 3, "human", 0) == mask);
  CHECK(area(disturbed_mask(mask, {.dropped_share = 1}, 3, "human", 1)) == 0);
}

}  // namespace noise_test
