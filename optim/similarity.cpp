#include "optim/similarity.h"

#include <cmath>
#include <limits>

#include <Eigen/LU>
#include <Eigen/SVD>

#include "core/check.h"
#include "core/types.h"

namespace hsi4d {
namespace {

/// The rotation that takes `from` to `to` best, and the sum of singular values with the sign that makes it one.
struct BestRotation {
  Matrix3<double> rotation;
  double trace;
};

/// @param covariance  Σ y xᵀ, finite
BestRotation best_rotation(const Matrix3<double>& covariance) {
  const Eigen::JacobiSVD<Matrix3<double>> svd(covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double sign = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
  const Vector3<double> signs(1, 1, sign);  // the smallest singular value gives way
  return {svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose(), svd.singularValues().dot(signs)};
}

Vector3<double> mean_of_all(std::span<const std::span<const double>> arrays, Index count) {
  Vector3<double> sum = Vector3<double>::Zero();
  for (const std::span<const double> array : arrays) {
    for (std::size_t i = 0; i < array.size(); i += 3) sum += Vector3<double>(array.data() + i);
  }
  return sum / static_cast<double>(count);
}

}  // namespace

Similarity fit_similarity(std::span<const std::span<const double>> from, std::span<const std::span<const double>> to,
                          FitScale scale) {
  HSI4D_CHECK_EQ(from.size(), to.size());
  Index count = 0;
  for (std::size_t a = 0; a < from.size(); ++a) {
    HSI4D_CHECK_EQ(from[a].size(), to[a].size());
    HSI4D_CHECK(from[a].size() % 3 == 0, "points are [N,3], not " + std::to_string(from[a].size()) + " numbers");
    count += static_cast<Index>(from[a].size()) / 3;
  }
  HSI4D_CHECK(count > 0, "there are no points to lay on others");
  Similarity fit{.from_mean = mean_of_all(from, count), .to_mean = mean_of_all(to, count)};
  double from_square = 0, to_square = 0;
  Matrix3<double> covariance = Matrix3<double>::Zero();
  for (std::size_t a = 0; a < from.size(); ++a) {
    for (std::size_t i = 0; i < from[a].size(); i += 3) {
      const Vector3<double> x = Vector3<double>(from[a].data() + i) - fit.from_mean;
      const Vector3<double> y = Vector3<double>(to[a].data() + i) - fit.to_mean;
      from_square += x.squaredNorm();
      to_square += y.squaredNorm();
      covariance += y * x.transpose();
    }
  }
  if (!std::isfinite(from_square) || !std::isfinite(to_square)) {
    fit.scale = std::numeric_limits<double>::quiet_NaN();
    return fit;
  }
  // Of unit size whatever the points' extent, so that the decomposition is as accurate for a hand as for a crowd.
  const double size = std::sqrt(from_square) * std::sqrt(to_square);
  BestRotation best = {Matrix3<double>::Identity(), 0};
  if (size > 0) best = best_rotation(covariance / size);
  fit.rotation = best.rotation;
  if (scale == FitScale::kOne) return fit;
  // tr(D S) / Σ|x|²; never negative, since the one singular value that may be subtracted is the smallest.
  fit.scale = size > 0 ? best.trace * (std::sqrt(to_square) / std::sqrt(from_square)) : 0;
  return fit;
}

}  // namespace hsi4d
