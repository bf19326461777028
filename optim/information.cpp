#include "optim/information.h"

#include <cmath>
#include <limits>

#include <Eigen/Eigenvalues>

#include "core/check.h"

namespace hsi4d {

Information::Information(const Eigen::MatrixXd& matrix) {
  HSI4D_CHECK(matrix.rows() == matrix.cols(), "an information matrix is square");
  HSI4D_CHECK(matrix.allFinite(), "an information matrix of finite numbers");
  const Index count = matrix.rows();
  scales_.setOnes(count);
  if (count == 0) return;
  // What is not known at all is on the scale of what is known best.
  const double largest = std::sqrt(std::max(0.0, matrix.diagonal().maxCoeff()));
  for (Index i = 0; i < count; ++i) {
    const double scale = matrix(i, i) > 0 ? std::sqrt(matrix(i, i)) : largest;
    scales_[i] = scale > 0 ? 1 / scale : 1;
  }
  const Eigen::MatrixXd scaled = scales_.asDiagonal() * matrix * scales_.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solved(scaled);
  vectors_ = solved.eigenvectors();
  roots_.setZero(count);
  for (Index k = 0; k < count; ++k) {
    const double eigenvalue = solved.eigenvalues()[k];
    if (eigenvalue > kLeastEigenvalue)
      roots_[k] = 1 / std::sqrt(eigenvalue);
    else
      ++unknown_;
  }
}

Eigen::VectorXd Information::sigmas(const Eigen::MatrixXd& jacobian) const {
  HSI4D_CHECK_EQ(jacobian.cols(), scales_.size());
  Eigen::VectorXd sigmas(jacobian.rows());
  for (Index r = 0; r < jacobian.rows(); ++r) {
    const Eigen::VectorXd scaled = scales_.cwiseProduct(jacobian.row(r).transpose());
    const Eigen::VectorXd parts = vectors_.transpose() * scaled;
    const bool is_unknown = parts.head(unknown_).norm() > kLeastShare * scaled.norm();
    sigmas[r] = is_unknown ? std::numeric_limits<double>::infinity() : parts.cwiseProduct(roots_).norm();
  }
  return sigmas;
}

}  // namespace hsi4d
