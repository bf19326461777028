#include "pipelines/draw/median_depth.h"

#include <cmath>

#include <catch2/catch.hpp>

#include "core/parallel.h"

namespace median_depth_test {

using namespace hsi4d;

namespace {

/// Flat, opaque Gaussians on the plane z = slope y + 3 of a world whose axes are the camera's, far from the world's
/// origin.
Gaussians plane(double slope, double opacity_logit) {
  Gaussians g;
  g.origin_world = Vector3<double>(100, 0, 0);
  const double angle = std::atan(slope), step = 0.08;
  for (int i = -40; i <= 40; ++i) {
    for (int j = -40; j <= 40; ++j) {
      const double x = step * i, y = step * j * std::cos(angle);
      for (const double m : {x, y, 3 + slope * y}) g.means.push_back(static_cast<float>(m));
      // Turns z to the plane's normal.
      for (const double q : {std::cos(0.5 * angle), std::sin(0.5 * angle), 0.0, 0.0})
        g.quats.push_back(static_cast<float>(2 * q));
      for (const double s : {step, step, 1e-4}) g.log_scales.push_back(static_cast<float>(std::log(s)));
      g.opacity_logits.push_back(static_cast<float>(opacity_logit));
      g.sh.insert(g.sh.end(), 3, 0.5F);
    }
  }
  return g;
}

SceneView front() {
  SceneView view;
  view.camera = {64, 48, 80, 80, 32, 24, {}};
  view.camera.camera_from_world.translation = Vector3<double>(-100, 0, 0);
  return view;
}

}  // namespace

TEST_CASE("the median depth of flat Gaussians is that of their plane, not of their middles", "[parallel]") {
  for (const double slope : {0.0, 0.7, -1.5}) {
    CAPTURE(slope);
    const SceneView view = front();
    const Gaussians scene = plane(slope, 3);
    const std::vector<float> depths = median_depths(scene, view);
    REQUIRE(depths.size() == 64 * 48);
    double worst = 0;
    for (int y = 8; y < 40; ++y) {
      for (int x = 8; x < 56; ++x) {
        const double ray = (y + 0.5 - 24) / 80, expected = 3 / (1 - slope * ray);
        worst = std::max(worst, std::abs(static_cast<double>(depths[static_cast<std::size_t>(64 * y + x)]) - expected));
      }
    }
    CHECK(worst < 2e-4);
    std::vector<float> one;
    with_threads(1, [&] { one = median_depths(scene, view); });
    CHECK(one == depths);
  }
}

TEST_CASE("where less than half of the light is stopped there is no depth") {
  const std::vector<float> depths = median_depths(plane(0, -5), front());
  CHECK(std::count(depths.begin(), depths.end(), 0.0F) == 64 * 48);
}

TEST_CASE("a round Gaussian is as far as the ray's nearest place to its middle") {
  Gaussians g;
  g.means = {0.2F, 0, 4};
  g.quats = {1, 0, 0, 0};
  g.log_scales = {std::log(0.3F), std::log(0.3F), std::log(0.3F)};
  g.opacity_logits = {5};
  g.sh = {0, 0, 0};
  SceneView view = front();
  view.camera.camera_from_world.translation = Vector3<double>::Zero();
  const std::vector<float> depths = median_depths(g, view);
  const Vector3<double> ray((35.5 - 32) / 80, (24.5 - 24) / 80, 1), mean(static_cast<double>(0.2F), 0, 4);
  CHECK(static_cast<double>(depths[24 * 64 + 35]) == Approx(ray.dot(mean) / ray.squaredNorm()).epsilon(1e-6));
}

}  // namespace median_depth_test
