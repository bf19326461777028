#include "splat/files/sh_rotation.h"

#include <array>
#include <cmath>
#include <numbers>

#include "core/check.h"
#include "splat/limits.h"
#include "splat/sh_basis.h"

namespace hsi4d {
namespace {

constexpr int kMostCoefficients = (kHighestShDegree + 1) * (kHighestShDegree + 1);

/// A point of the rule and its weight; the weights sum to 1.
struct RulePoint {
  Vector3<double> direction;
  double weight;
};

/// The directions from the middle of a cube to its faces, edges and corners.
std::vector<RulePoint> rule() {
  std::vector<RulePoint> points;
  for (int x = -1; x <= 1; ++x) {
    for (int y = -1; y <= 1; ++y) {
      for (int z = -1; z <= 1; ++z) {
        const int sum = x * x + y * y + z * z;
        if (sum == 0) continue;
        const double weight = sum == 1 ? 1.0 / 21 : sum == 2 ? 4.0 / 105 : 9.0 / 280;
        points.push_back({Vector3<double>(x, y, z) / std::sqrt(static_cast<double>(sum)), weight});
      }
    }
  }
  return points;
}

}  // namespace

ShRotation::ShRotation(const Matrix3<double>& rotation, int degree) {
  HSI4D_CHECK(degree >= 0 && degree <= kHighestShDegree, "harmonics of degree " + std::to_string(degree));
  for (int l = 0; l <= degree; ++l) blocks_.emplace_back(static_cast<std::size_t>((2 * l + 1) * (2 * l + 1)), 0.0);
  std::array<double, kMostCoefficients> from{}, to{};
  for (const RulePoint& point : rule()) {
    const Vector3<double>& r = point.direction;
    const Vector3<double> turned = rotation * r;
    sh_basis(degree, r[0], r[1], r[2], from.data());
    sh_basis(degree, turned[0], turned[1], turned[2], to.data());
    for (int l = 0; l <= degree; ++l) {
      const int width = 2 * l + 1;
      const double* y_to = to.data() + l * l;
      const double* y_from = from.data() + l * l;
      std::vector<double>& block = blocks_[static_cast<std::size_t>(l)];
      for (int i = 0; i < width * width; ++i)
        block[static_cast<std::size_t>(i)] += 4 * std::numbers::pi * point.weight * y_to[i / width] * y_from[i % width];
    }
  }
}

void ShRotation::apply(std::span<float> sh) const {
  HSI4D_CHECK_EQ(sh.size(), 3 * blocks_.size() * blocks_.size());
  for (int l = 1; l < static_cast<int>(blocks_.size()); ++l) {
    const int width = 2 * l + 1;
    float* part = sh.data() + 3 * l * l;
    for (int c = 0; c < 3; ++c) {
      std::array<double, 2 * kHighestShDegree + 1> old{};
      for (int k = 0; k < width; ++k) old[static_cast<std::size_t>(k)] = part[3 * k + c];
      for (int row = 0; row < width; ++row) {
        double sum = 0;
        for (int k = 0; k < width; ++k) sum += entry(l, row, k) * old[static_cast<std::size_t>(k)];
        part[3 * row + c] = static_cast<float>(sum);
      }
    }
  }
}

}  // namespace hsi4d
