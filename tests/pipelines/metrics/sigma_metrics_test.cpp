// What summaries tell of how sure places are.
#include "pipelines/metrics/sigma_metrics.h"

#include <limits>

#include <catch2/catch.hpp>

#include "core/check.h"

namespace sigma_metrics_test {

using namespace hsi4d;

namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();

/// Two joints and an object, seen along the world's y: the camera's z.
FrameState truth() {
  FrameState state;
  state.joints = {0, 0, 0, 1, 1, 1};
  state.world_from_object.emplace_back();
  Rigid<double> camera;
  camera.rotation << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  state.camera_from_world = camera;
  return state;
}

/// One joint off by 10 mm along x, 30 mm along the view; the other by 1 mm along z; the object by 2 cm along the view.
FrameState estimate() {
  FrameState state = truth();
  state.joints = {0.01, 0.03, 0, 1, 1, 1.001};
  state.world_from_object[0].translation = {0, -0.02, 0};
  return state;
}

double value_of(const MetricValues& values, const std::string& name) {
  const double* const value = find_metric(values, name);
  INFO(name);
  REQUIRE(value != nullptr);
  return *value;
}

}  // namespace

TEST_CASE("sigmas are told as means, and how many errors are within them") {
  const PlaceSigmas sigmas{{{0.005, 0.04}, {0.007, 0.02}}, {{0.004, 0.01}}};
  const FrameState real = truth();
  const MetricValues values = sigma_values(sigmas, estimate(), &real);
  CHECK(values.size() == 8);
  CHECK(value_of(values, "sigma_image_mm") == Approx(6));
  CHECK(value_of(values, "sigma_depth_mm") == Approx(30));
  CHECK(value_of(values, "within_sigma_image") == Approx(0.75));
  CHECK(value_of(values, "within_sigma_depth") == Approx(1));
  CHECK(value_of(values, "object_sigma_image_cm") == Approx(0.4));
  CHECK(value_of(values, "object_sigma_depth_cm") == Approx(1));
  CHECK(value_of(values, "object_within_sigma_image") == Approx(1));
  CHECK(value_of(values, "object_within_sigma_depth") == Approx(0));
  CHECK(sigma_values(sigmas, estimate(), nullptr).size() == 4);
}

TEST_CASE("places that nothing tells are counted, and left out of means") {
  const FrameState real = truth();
  const MetricValues values = sigma_values({{{0.005, kInfinite}, {0.007, 0.02}}, {{kUnsure, 0.01}}}, estimate(), &real);
  CHECK(value_of(values, "unsure_share") == Approx(2.0 / 3));
  CHECK(value_of(values, "sigma_depth_mm") == Approx(20));
  CHECK(value_of(values, "within_sigma_image") == Approx(1));
  CHECK(find_metric(values, "object_sigma_depth_cm") == nullptr);
}

TEST_CASE("nothing is told of a frame that was given") {
  const FrameState real = truth();
  PlaceSigmas given = no_sigmas(1);
  given.joints.resize(2);
  CHECK(sigma_values(given, estimate(), &real).empty());
  CHECK_THROWS_AS(sigma_values(no_sigmas(1), estimate(), &real), InternalError);  // 22 joints of 2
}

}  // namespace sigma_metrics_test
