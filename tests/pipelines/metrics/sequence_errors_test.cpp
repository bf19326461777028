#include "pipelines/metrics/sequence_errors.h"

#include <cmath>
#include <numbers>

#include <catch2/catch.hpp>

#include "core/camera.h"
#include "core/check.h"
#include "optim/metrics.h"

namespace sequence_errors_test {

using namespace hsi4d;

namespace {

/// A pelvis and a head at `x`, an object beside them, a camera that looks along the world's y.
FrameState state_at(double x) {
  FrameState state;
  state.joints = {x, 0, 1, x, 0, 1.6};
  state.world_from_object = {{Matrix3<double>::Identity(), Vector3<double>(x + 1, 0, 0.5)}};
  state.camera_from_world = look_at(Vector3<double>(0, -4, 1), Vector3<double>(0, 0, 1));
  return state;
}

double value(const MetricValues& values, const std::string& name) {
  const double* const found = find_metric(values, name);
  REQUIRE(found != nullptr);
  return *found;
}

}  // namespace

TEST_CASE("the errors of a frame have the names and units of the summary") {
  const FrameState truth = state_at(0);
  FrameState estimate = state_at(0.03);                          // 3 cm across the view
  for (size_t i = 1; i < 6; i += 3) estimate.joints[i] += 0.04;  // 4 cm away from the camera
  estimate.world_from_object[0].rotation = so3_exp(Vector3<double>(0, 0, std::numbers::pi / 6));
  const MetricValues errors = frame_errors(estimate, truth);
  CHECK(value(errors, "mpjpe_mm") == Approx(0).margin(1e-9));
  CHECK(value(errors, "world_mpjpe_mm") == Approx(50));
  CHECK(value(errors, "world_mpjpe_image_mm") == Approx(30));
  CHECK(value(errors, "world_mpjpe_depth_mm") == Approx(40));
  CHECK(value(errors, "root_translation_mm") == Approx(50));
  CHECK(value(errors, "object_translation_cm") == Approx(3));
  CHECK(value(errors, "object_rotation_deg") == Approx(30));
  CHECK(value(errors, "camera_translation_cm") == 0);
  CHECK(value(errors, "camera_rotation_deg") == Approx(0).margin(1e-9));
  for (const auto& [name, number] : errors) CHECK(find_metric_facts(name) != nullptr);
}

TEST_CASE("points of the objects give ADD and ADD-S as means over the objects") {
  const FrameState truth = state_at(0);
  FrameState estimate = state_at(0);
  estimate.world_from_object[0].translation[2] += 0.03;
  Gaussians pair;
  pair.means = {0.5F, 0, 0, -0.5F, 0, 0};
  pair.opacity_logits = {0, 0};
  const ObjectPoints points({&pair});
  CHECK(value(frame_errors(estimate, truth, &points), "object_add_cm") == Approx(3));
  CHECK(value(frame_errors(estimate, truth, &points), "object_add_s_cm") == Approx(3));
  CHECK(find_metric(frame_errors(estimate, truth), "object_add_cm") == nullptr);
  const ObjectPoints two({&pair, &pair});
  CHECK_THROWS_AS(frame_errors(estimate, truth, &two), InternalError);
}

TEST_CASE("what is absent is not measured") {
  FrameState estimate = state_at(0), truth = state_at(0);
  estimate.joints.clear();
  truth.world_from_object.clear();
  const MetricValues errors = frame_errors(estimate, truth);
  CHECK(errors.size() == 2);  // the camera's
  CHECK(find_metric(errors, "mpjpe_mm") == nullptr);
  FrameState two = state_at(0);
  two.world_from_object.resize(2);
  CHECK_THROWS_AS(frame_errors(two, state_at(0)), InternalError);
}

TEST_CASE("means over a sequence leave out frame 0, which is given") {
  std::vector<FrameState> truth, estimate;
  for (int t = 0; t < 5; ++t) {
    truth.push_back(state_at(0));
    estimate.push_back(state_at(t == 0 ? 100 : t * 0.01));
  }
  const std::vector<FrameMetrics> per_frame = sequence_errors(estimate, truth, 10);
  REQUIRE(per_frame.size() == 4);
  CHECK(per_frame[0].frame == 1);
  CHECK(value(per_frame[3].values, "root_translation_mm") == Approx(40));
  estimate[0] = truth[0];
  const MetricValues means = sequence_summary(estimate, truth, 10);
  CHECK(value(means, "root_translation_mm") == Approx(25));
  CHECK(value(means, "jitter") == Approx(0).margin(1e-9));  // a constant speed from frame 0 on
  CHECK(value(means, "acceleration_error") == Approx(0).margin(1e-9));
  CHECK(find_metric(per_frame[3].values, "acceleration_error") == nullptr);  // there is no frame after it
  CHECK(value(per_frame[0].values, "acceleration_error") > 1000);            // of frame 0, 100 m away
  const std::vector<FrameState> three(estimate.begin(), estimate.begin() + 3);
  CHECK(find_metric(sequence_summary(three, std::span(truth).first(3), 10), "jitter") == nullptr);
  CHECK_THROWS_AS(sequence_errors(three, truth, 10), InternalError);
}

TEST_CASE("a metric that some frames lack is averaged over those that have it") {
  const std::vector<FrameMetrics> frames = {
      {1, {{"psnr_db", 20}}}, {2, {{"psnr_db", 30}, {"psnr_foreground_db", 10}}}, {3, {{"psnr_foreground_db", 20}}}};
  CHECK(mean_errors(frames) == MetricValues{{"psnr_db", 25}, {"psnr_foreground_db", 15}});
  CHECK(mean_errors({}).empty());
}

TEST_CASE("the errors of images leave out a foreground that is not there") {
  Image image(3, 16, 16), target(3, 16, 16), mask(1, 16, 16);
  image(0, 3, 3) = 0.5F;
  const MetricValues plain = image_errors(image, target);
  CHECK(plain.size() == 2);
  CHECK(value(plain, "psnr_db") == Approx(-10 * std::log10(0.25 / (3 * 256))));
  const MetricValues of_nothing = image_errors(image, target, &mask);
  CHECK(of_nothing.size() == 3);
  CHECK(value(of_nothing, "psnr_background_db") == value(plain, "psnr_db"));
  mask(0, 3, 3) = 1;
  CHECK(value(image_errors(image, target, &mask), "psnr_background_db") == kLargestPsnrDb);
  CHECK(value(image_errors(image, target, &mask), "psnr_foreground_db") == Approx(-10 * std::log10(0.25 / 3)));
}

}  // namespace sequence_errors_test
