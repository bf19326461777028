#include "pipelines/metrics/background_errors.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <catch2/catch.hpp>

namespace background_errors_test {

using namespace hsi4d;

namespace {

constexpr int kWidth = 320, kHeight = 200;

/// A picture of waves, which has a colour between pixels too; long ones are high, as in photographs.
double wave(int c, double y, double x) {
  return 0.5 + 0.18 * std::sin(0.03 * x + 0.015 * y) + 0.14 * std::sin(0.015 * x - 0.04 * y + 0.5 * c) +
         0.06 * std::sin(0.11 * x + 0.05 * y + c) + 0.03 * std::sin(0.31 * x - 0.23 * y);
}

/// @param from  (x, y) in the picture of waves of a pixel
template <class F>
Image picture(const F& from) {
  Image image(3, kHeight, kWidth);
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const auto [u, v] = from(static_cast<double>(x), static_cast<double>(y));
        image(c, y, x) = static_cast<float>(wave(c, v, u));
      }
    }
  }
  return image;
}

Image still() {
  return picture([](double x, double y) { return std::pair(x, y); });
}

Image everywhere() {
  Image background(1, kHeight, kWidth);
  for (int y = 0; y < kHeight; ++y) std::fill(background.row(0, y), background.row(0, y) + kWidth, 1.0F);
  return background;
}

/// Sets a rectangle of all channels.
void fill(Image& image, int top, int left, int height, int width, float value) {
  for (int c = 0; c < image.channels(); ++c) {
    for (int y = top; y < top + height; ++y) std::fill(image.row(c, y) + left, image.row(c, y) + left + width, value);
  }
}

double value(const MetricValues& values, const char* name) {
  const double* const found = find_metric(values, name);
  REQUIRE(found != nullptr);
  return *found;
}

}  // namespace

TEST_CASE("what agrees neither drifts nor changes") {
  const MetricValues errors = background_errors(still(), still(), everywhere());
  CHECK(value(errors, "camera_drift_px") < 1e-3);
  CHECK(value(errors, "background_change") == 0);
}

TEST_CASE("a shift is found in pixels of the images that are given") {
  const auto [right, down] = GENERATE(std::pair(0.6, -0.3), std::pair(-3.0, 4.0), std::pair(12.0, 9.0));
  const Image frame = picture([=](double x, double y) { return std::pair(x - right, y - down); });
  const MetricValues errors = background_errors(still(), frame, everywhere());
  CHECK(value(errors, "camera_drift_px") == Approx(std::hypot(right, down)).margin(0.03));
  CHECK(value(errors, "background_change") < 0.001);
}

TEST_CASE("a turn about the middle is a drift that grows outwards") {
  const double turn = 0.02, middle_x = (kWidth - 1) / 2.0, middle_y = (kHeight - 1) / 2.0;
  const Image frame = picture([=](double x, double y) {
    const double right = x - middle_x, down = y - middle_y;
    return std::pair(middle_x + std::cos(turn) * right + std::sin(turn) * down,
                     middle_y - std::sin(turn) * right + std::cos(turn) * down);
  });
  double sum = 0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) sum += 2 * std::sin(turn / 2) * std::hypot(x - middle_x, y - middle_y);
  }
  CHECK(value(background_errors(still(), frame, everywhere()), "camera_drift_px") ==
        Approx(sum / (kWidth * kHeight)).epsilon(0.03));
}

TEST_CASE("exposure is no change, and moves nothing") {
  Image frame = picture([](double x, double y) { return std::pair(x - 2, y); });
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      frame(0, y, x) = 0.7F * frame(0, y, x) + 0.1F;
      frame(1, y, x) = 0.7F * frame(1, y, x);
      frame(2, y, x) = 0.7F * frame(2, y, x) - 0.1F;
    }
  }
  const MetricValues errors = background_errors(still(), frame, everywhere());
  CHECK(value(errors, "camera_drift_px") == Approx(2).margin(0.03));
  CHECK(value(errors, "background_change") < 0.001);
}

TEST_CASE("what is painted anew is a share of the background, and hardly moves the rest") {
  Image frame = picture([](double x, double y) { return std::pair(x - 1.5, y); });
  fill(frame, 40, 60, 100, 128, 0.02F);
  const MetricValues errors = background_errors(still(), frame, everywhere());
  CHECK(value(errors, "background_change") == Approx(0.2).margin(0.01));
  CHECK(value(errors, "camera_drift_px") == Approx(1.5).margin(0.1));
}

TEST_CASE("what is no background does not count") {
  Image frame = still(), background = everywhere();
  fill(frame, 40, 60, 100, 128, 0.02F);
  fill(background, 36, 56, 108, 136, 0);
  const MetricValues errors = background_errors(still(), frame, background);
  CHECK(value(errors, "background_change") == 0);
  CHECK(value(errors, "camera_drift_px") < 0.01);
  fill(background, 0, 0, kHeight, kWidth, 0);
  CHECK(background_errors(still(), frame, background).empty());
}

TEST_CASE("of a background without texture no drift is told") {
  Image grey(3, kHeight, kWidth), bright(3, kHeight, kWidth);
  fill(grey, 0, 0, kHeight, kWidth, 0.5F);
  fill(bright, 0, 0, kHeight, kWidth, 0.5F);
  fill(bright, 0, 0, kHeight, kWidth / 4, 0.9F);
  const MetricValues errors = background_errors(grey, bright, everywhere());
  CHECK(find_metric(errors, "camera_drift_px") == nullptr);
  CHECK(value(errors, "background_change") == Approx(0.25).margin(0.01));
}

}  // namespace background_errors_test
