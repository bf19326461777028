// Natural poses of the human body, by anatomy: what every joint does at ease, how much it moves, and how far it goes.
//
// The table is for the joints 1 to 21 of SMPL-X, in the frame of its rest pose (a T; x to the body's left, y up, z
// forward), so that x, y and z are anatomical axes:
//
//   legs, spine, neck   x bends (a hip forward by −, a knee back by +, the trunk forward by +), y twists, z sideways
//   arms                x twists, y swings forward and back, z up and down; an elbow bends about y
//
// Numbers are those of a left limb; a right one has y and z of the other sign. They are not fitted to data: ranges are
// those of healthy adults, given a few degrees more because a model's joints share a movement otherwise than ours, and
// the spread of a natural pose is about a fifth of its range.
//
// Natural poses as a distribution: R_j = exp(m_j) exp(s_j ∘ z_j), z normal, with the pose at ease m_j and the spread
// s_j about the bone's own axes. So 63 numbers stand for a pose as VPoser's latents do, and their squares for how
// unlikely it is.
#pragma once

#include <span>

#include "autodiff/tape.h"
#include "core/linear.h"

namespace hsi4d {

/// What a joint does, about x, y and z; degrees.
struct NaturalJoint {
  const char* name;
  int twist_axis;  ///< the bone's: 0 x, 1 y
  double ease[3];  ///< rotation vector of the pose at ease
  double spread[3];
  double low[3], high[3];  ///< of twist and swing, see joint_limit_excess
};

/// The joints 1 to 21 of SMPL-X.
std::span<const NaturalJoint> natural_joints();

/// Poses of z.
///
/// @param latents  [T,63], three numbers a joint
/// @return         [21T,9] rotation matrices by rows, relative to the parents; joint j of frame t is row 21 t + j − 1
/// Adjoint: latents.
template <class S>
Var<S> natural_decode(Var<S> latents, Source where = Source::current());

/// z of poses, log(exp(m)ᵀ R) / s.
///
/// @param rotations  [21T,9]
/// @return           [T,63]
/// Adjoint: rotations, as functions of nine free numbers each; see axis_angle_from_rotations.
template <class S>
Var<S> natural_encode(Var<S> rotations, Source where = Source::current());

/// How far joints are beyond their ranges, Σ over the three angles of max(0, x − high)² + max(0, low − x)².
///
/// A rotation is a twist τ about the bone followed by a swing across it (rows D7, D9: angles stay within π): with the
/// quaternion (w, v), w ≥ 0, and the bone's axis a,
///
///   n² = w² + (v·a)²,   τ = 2 atan2(v·a, w),   swing = 2 atan2(|u|, n)/|u| (w u − (v·a) u × a)/n,   u = v − (v·a) a
///
/// At half a turn of swing (n < kLeastTwist) the twist is taken as 0.
///
/// @param rotations  [21T,9] rotation matrices by rows
/// @return           [21T,1] radians²; NaN of a rotation that is not finite
/// Adjoint: rotations, as functions of nine free numbers each. None to the twist where it is taken as 0. Pivots, sides
/// and that choice are part of the signature.
template <class S>
Var<S> joint_limit_excess(Var<S> rotations, Source where = Source::current());

inline constexpr double kLeastTwist = 1e-6;

/// The angles that joint_limit_excess compares with a joint's range, about x, y and z; radians.
Vector3<double> twist_and_swing(const Matrix3<double>& rotation, int twist_axis);

}  // namespace hsi4d
