// Formulas of complex numbers that the checks of more than one layer compare with.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "body/natural_pose.h"
#include "core/rotation.h"
#include "tests/support/complex_step_check.h"

namespace hsi4d::test {

/// 1 − mean ssim, by its definition.
inline Complexes plain_d_ssim(const Complexes& x, const Complexes& y, int height, int width) {
  std::array<double, 11> window{};
  double total = 0;
  for (int i = 0; i < 11; ++i) total += window[static_cast<std::size_t>(i)] = std::exp(-(i - 5) * (i - 5) / 4.5);
  const auto filtered = [&](int r, int c, const auto& value) {
    Complex sum = 0;
    for (int i = std::max(0, r - 5); i < std::min(height, r + 6); ++i) {
      for (int j = std::max(0, c - 5); j < std::min(width, c + 6); ++j) {
        const double w = window[static_cast<std::size_t>(i - r + 5)] * window[static_cast<std::size_t>(j - c + 5)];
        sum += w / (total * total) * value(static_cast<std::size_t>(i * width + j));
      }
    }
    return sum;
  };
  Complex sum = 0;
  for (int r = 0; r < height; ++r) {
    for (int c = 0; c < width; ++c) {
      const Complex mx = filtered(r, c, [&](std::size_t i) { return x[i]; });
      const Complex my = filtered(r, c, [&](std::size_t i) { return y[i]; });
      const Complex vx = filtered(r, c, [&](std::size_t i) { return x[i] * x[i]; }) - mx * mx;
      const Complex vy = filtered(r, c, [&](std::size_t i) { return y[i] * y[i]; }) - my * my;
      const Complex vxy = filtered(r, c, [&](std::size_t i) { return x[i] * y[i]; }) - mx * my;
      constexpr double kC1 = 1e-4, kC2 = 9e-4;
      sum += (2.0 * mx * my + kC1) * (2.0 * vxy + kC2) / ((mx * mx + my * my + kC1) * (vx + vy + kC2));
    }
  }
  return {1.0 - sum / static_cast<double>(height * width)};
}

/// Σ (angle beyond its range)² of a rotation: twist about the bone, swing across it.
inline Complex plain_excess(const Matrix3<Complex>& rotation, const NaturalJoint& joint) {
  const Vector4<Complex> q = quaternion_from_matrix(rotation);
  const int k = joint.twist_axis, i = (k + 1) % 3, j = (k + 2) % 3;
  const Complex w = q[0], s = q[1 + k], u_i = q[1 + i], u_j = q[1 + j];
  const Complex n = std::sqrt(w * w + s * s), m = std::sqrt(u_i * u_i + u_j * u_j);
  const Complex ratio = 2.0 * hsi4d::detail::angle_of(m, n) / m;
  Vector3<Complex> angles;
  angles[k] = 2.0 * hsi4d::detail::angle_of(s, w);
  angles[i] = ratio * (w * u_i - s * u_j) / n;
  angles[j] = ratio * (w * u_j + s * u_i) / n;
  Complex sum = 0;
  for (int axis = 0; axis < 3; ++axis) {
    constexpr double kRadians = 3.14159265358979323846 / 180;
    const Complex x = angles[axis];
    const double low = joint.low[axis] * kRadians, high = joint.high[axis] * kRadians;
    const Complex beyond = x.real() > high ? x - high : x.real() < low ? x - low : 0;
    sum += beyond * beyond;
  }
  return sum;
}

}  // namespace hsi4d::test
