// Which pixels a body's surface covers, to hold a render of Gaussians to it.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "body/surface_index.h"
#include "core/camera.h"

namespace hsi4d::test {

/// [H,W] whether the surface covers the whole pixel: 5 by 5 points of it, from edge to edge. All of the body must be in
/// front of the camera.
inline std::vector<char> covered_pixels(const BodyModel& body, const Camera& camera) {
  constexpr int kParts = 4;
  const int width = kParts * camera.width + 1, height = kParts * camera.height + 1;
  std::vector<char> points(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), 0);
  for (std::int32_t face = 0; face < body.face_count(); ++face) {
    std::array<Vector2<double>, 3> corners;
    const std::array<Vector3<double>, 3> world = face_corners(body, face);
    for (std::size_t i = 0; i < 3; ++i) {
      const Vector3<double> p = camera.camera_from_world.rotation * world[i] + camera.camera_from_world.translation;
      corners[i] = {kParts * (camera.fx * p[0] / p[2] + camera.cx), kParts * (camera.fy * p[1] / p[2] + camera.cy)};
    }
    const auto side = [&](std::size_t i, double x, double y) {
      const Vector2<double> a = corners[i], b = corners[(i + 1) % 3];
      return (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]);
    };
    const auto range = [&](int axis, int end) {
      const auto [low, high] = std::minmax({corners[0][axis], corners[1][axis], corners[2][axis]});
      return std::pair(std::max(0, static_cast<int>(std::ceil(low))), std::min(end - 1, static_cast<int>(high)));
    };
    const auto [left, right] = range(0, width);
    const auto [top, bottom] = range(1, height);
    for (int y = top; y <= bottom; ++y) {
      for (int x = left; x <= right; ++x) {
        const double a = side(0, x, y), b = side(1, x, y), c = side(2, x, y);
        if (std::max({a, b, c}) <= 1e-9 || std::min({a, b, c}) >= -1e-9)
          points[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)] = 1;
      }
    }
  }
  std::vector<char> covered;
  for (int row = 0; row < camera.height; ++row) {
    for (int column = 0; column < camera.width; ++column) {
      char whole = 1;
      for (int y = kParts * row; y <= kParts * (row + 1); ++y) {
        for (int x = kParts * column; x <= kParts * (column + 1); ++x)
          whole &= points[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)];
      }
      covered.push_back(whole);
    }
  }
  return covered;
}

}  // namespace hsi4d::test
