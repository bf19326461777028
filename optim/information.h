// What an information matrix says of numbers that depend on the parameters: how sure they are.
//
//   x ~ H⁺   y = J x,   var y = J H⁺ Jᵀ,   H = Σ r rᵀ / σ² of everything that was measured, priors included
//
// Parameters have all units, and some are known a million times better than others. So H is brought to a diagonal of
// ones before its eigenvalues are looked at, and what counts as nothing does not depend on units:
//
//   D = diag(H)^½,   D⁻¹ H D⁻¹ = V Λ Vᵀ,   var y = Σ_k (v_k · D⁻¹ jᵀ)² / λ_k
#pragma once

#include <Eigen/Core>

#include "core/types.h"

namespace hsi4d {

/// The inverse of an information matrix, where it has one.
class Information {
 public:
  /// Eigenvalues of the matrix with ones on its diagonal up to this are those of directions of which nothing is known:
  /// rounding in float leaves 1e-13.
  static constexpr double kLeastEigenvalue = 1e-10;
  /// A number of which more than this share depends on such a direction is not known. Less is rounding: what is in
  /// float mixes such directions with others that are hardly known.
  static constexpr double kLeastShare = 0.01;

  /// @param matrix  H [n,n], symmetric and positive semi-definite to rounding; its lower triangle counts
  /// Throws InternalError where a number is not finite.
  explicit Information(const Eigen::MatrixXd& matrix);

  /// One standard deviation of each row's y = j x, in y's unit: infinite where it depends on a direction of which
  /// nothing is known, 0 where it depends on nothing.
  /// @param jacobian  [k,n]
  Eigen::VectorXd sigmas(const Eigen::MatrixXd& jacobian) const;

  /// Directions of which nothing is known.
  Index unknown_directions() const { return unknown_; }

 private:
  Eigen::VectorXd scales_;   // 1 / D
  Eigen::VectorXd roots_;    // 1 / √Λ; of directions that are not known 0
  Eigen::MatrixXd vectors_;  // V, its columns in the order of Λ, the smallest first
  Index unknown_ = 0;
};

}  // namespace hsi4d
