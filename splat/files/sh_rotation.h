// How real spherical harmonics change when what they belong to is rotated.
#pragma once

#include <span>
#include <vector>

#include "core/linear.h"

namespace hsi4d {

/// The matrices that rotate spherical harmonics, one for each degree l = 0 … degree:
///
///   Y_l(R r) = D_l(R) Y_l(r) for every unit vector r
///   D_l = 4π Σᵢ wᵢ Y_l(R rᵢ) Y_l(rᵢ)ᵀ   over the 26 points of a rule that integrates polynomials up to degree 7
///   exactly
///                                                                                         [Lebedev 1976]
///
/// D_l is orthogonal, and D_l(A B) = D_l(A) D_l(B). Nothing is solved for, so the error is a few roundings.
class ShRotation {
 public:
  /// @param rotation  orthogonal with determinant 1; the caller has checked it
  /// @param degree    0 to kHighestShDegree
  ShRotation(const Matrix3<double>& rotation, int degree);

  /// Entry of D_l, rows and columns 0 to 2l.
  double entry(int l, int row, int column) const {
    return blocks_[static_cast<std::size_t>(l)][static_cast<std::size_t>(row * (2 * l + 1) + column)];
  }

  /// Coefficients so that the rotated function has at R r the value that the old one has at r: sh_l ← D_l sh_l.
  ///
  /// @param sh  [K,3] of one Gaussian, changed in place; summed in double
  void apply(std::span<float> sh) const;

 private:
  std::vector<std::vector<double>> blocks_;
};

}  // namespace hsi4d
