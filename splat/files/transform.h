// Similarity transforms of Gaussians: x ↦ s R x + t.
#pragma once

#include <string>

#include "splat/gaussians.h"

namespace hsi4d {

/// x ↦ scale · rotation · x + translation.
struct Similarity {
  double scale = 1;                                        ///< > 0
  Matrix3<double> rotation = Matrix3<double>::Identity();  ///< determinant 1
  Vector3<double> translation = Vector3<double>::Zero();   ///< metres
};

/// outer(inner(x)).
Similarity compose(const Similarity& outer, const Similarity& inner);

/// x ↦ Rᵀ (x − t)/s.
Similarity inverse(const Similarity& similarity);

/// s R x + t.
Vector3<double> transform_point(const Similarity& similarity, const Vector3<double>& point);

/// The similarity that a matrix [s R, t; 0, 1] is. Its rotation is the nearest one, exact to rounding.
///
/// @param where  starts messages: "hsi4d convert: --matrix"
/// Throws UserError for a matrix that is none: numbers that are not finite, a last row that is not 0 0 0 1, one that
/// mirrors, shears or scales the axes differently (an entry of AᵀA/s² − I beyond 1e-4), or one without extent.
Similarity similarity_from_matrix(const Matrix4<double>& matrix, const std::string& where);

/// The Gaussians moved, turned and scaled as one body: what a camera sees that goes along is the same.
///
///   origin ← s R origin + t,   mean ← s R mean,   quaternion ← q(R) quaternion,   log-scale ← log-scale + log s,
///   sh_l ← D_l(R) sh_l (splat/files/sh_rotation.h)
///
/// Computed in double and rounded once. The translation goes to the origin, so means far out lose no digits.
/// Throws InternalError as check_sizes, or where scale ≤ 0 or the rotation is none (1e-6).
Gaussians transformed(const Gaussians& gaussians, const Similarity& similarity);

}  // namespace hsi4d
