// Rotation matrices of arrays of joints, from axis-angle vectors and from pairs of columns ("6D"), and back.
//
// Each row is one call of so3_exp, so3_log (core/rotation.h) or rotation_from_6d (core/rotation_6d.h), value and
// adjoint, so nothing is special at the identity, near half a turn or at parallel columns.
#pragma once

#include "autodiff/tape.h"

namespace hsi4d {

/// R_j = exp(w_j), Rodrigues' formula with coefficients that are functions of |w|² (rows C1-C4: small angles).
///
/// @param axis_angle  [J,3] radians
/// @return            [J,9] rotation matrices, row-major
/// Adjoint: axis_angle; at 0 it is that of the generators, neither 0 nor NaN.
/// Throws InternalError when the rows are not of 3.
template <class S>
Var<S> rotations_from_axis_angle(Var<S> axis_angle, Source where = Source::current());

/// R_j = [b1 b2 b3] of two columns a, b by Gram and Schmidt. [Zhou et al. 2019, section B; rows C9]
///
/// @param columns  [J,6], (a, b): a = x[0..2], b = x[3..5], any lengths
/// @return         [J,9] rotation matrices, row-major; a rotation in every case
/// Adjoint: columns. None to a column that had to be replaced (zero, not finite, or b parallel to a within
/// kParallel6d). Which ones were is part of the signature, so that a gradient check can tell. Throws InternalError when
/// the rows are not of 6.
template <class S>
Var<S> rotations_from_6d(Var<S> columns, Source where = Source::current());

/// w_j = log R_j, |w_j| ≤ π, by the largest pivot's quaternion (row C5: angle near π).
///
/// @param rotations  [J,9] rotation matrices, row-major
/// @return           [J,3] axis-angle, radians
/// Adjoint: rotations, of the pivot's formula as a function of nine free numbers. The result jumps at half a turn:
/// which pivot was taken, and on which side, is part of the signature. Throws InternalError when the rows are not of 9.
template <class S>
Var<S> axis_angle_from_rotations(Var<S> rotations, Source where = Source::current());

}  // namespace hsi4d
