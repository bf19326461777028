// A film of a shape that moves over a patterned ground, behind a bar that stands still.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "core/image.h"

namespace hsi4d::test {

struct MovingShapes {
  int frames = 12, width = 160, height = 120;
  double object_size = 16;          ///< half a side
  double step_px = 5;               ///< to the right, a frame
  double turn_deg = 0, growth = 1;  ///< a frame
  double bar_width = 0;             ///< 0: no bar

  std::array<double, 2> object_center(int t) const { return {30 + step_px * t, 62 + 4 * std::sin(0.4 * t)}; }

  /// [1,H,W] 0 or 1: what is seen of the object.
  Image object_mask(int t) const { return painted(t, 1); }
  Image bar_mask(int t) const { return painted(t, 2); }

  Image frame(int t) const {
    Image image(3, height, width);
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        for (int c = 0; c < 3; ++c) image(c, y, x) = color(part_at(t, y, x), t, c, y, x);
      }
    }
    return image;
  }

 private:
  /// The pixel's place relative to the object, as it is in frame 0.
  std::array<double, 2> place_in_object(int t, int y, int x) const {
    const auto [center_x, center_y] = object_center(t);
    const double angle = turn_deg * t * std::numbers::pi / 180, size = std::pow(growth, t);
    const double dx = (x - center_x) / size, dy = (y - center_y) / size;
    return {std::cos(angle) * dx + std::sin(angle) * dy, -std::sin(angle) * dx + std::cos(angle) * dy};
  }

  /// 0 the ground, 1 the object, a block without a corner, 2 the bar.
  int part_at(int t, int y, int x) const {
    if (std::abs(x - 80) < bar_width / 2) return 2;
    const auto [u, v] = place_in_object(t, y, x);
    const bool is_in = std::abs(u) < object_size && std::abs(v) < object_size && u + v < 1.3 * object_size;
    return is_in ? 1 : 0;
  }

  float color(int part, int t, int c, int y, int x) const {
    if (part == 2) return c == 2 ? 0.25F : 0.6F + 0.05F * static_cast<float>(std::sin(0.9 * y));
    if (part == 0)
      return static_cast<float>(0.45 + 0.12 * std::sin(0.21 * x + 0.13 * y + c) + 0.08 * std::cos(0.37 * y - 0.11 * x));
    const auto [u, v] = place_in_object(t, y, x);
    const double pattern = 0.1 * std::sin(0.5 * u) * std::cos(0.4 * v);
    return static_cast<float>((c == 0 ? 0.75 : 0.25) + pattern);
  }

  Image painted(int t, int part) const {
    Image mask(1, height, width);
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) mask(0, y, x) = part_at(t, y, x) == part ? 1.0F : 0.0F;
    }
    return mask;
  }
};

inline double mask_area(const Image& mask) {
  double sum = 0;
  for (int y = 0; y < mask.height(); ++y)
    sum += static_cast<double>(
        std::count_if(mask.row(0, y), mask.row(0, y) + mask.width(), [](float v) { return v > 0.5F; }));
  return sum;
}

}  // namespace hsi4d::test
