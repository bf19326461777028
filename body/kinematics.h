// Forward kinematics of a skeleton.
//
//   R_0 = L_0,  p_0 = r_0;     R_j = R_q L_j,  p_j = p_q + R_q (r_j − r_q),  q = parent of j
//   A_j = [R_j | p_j − R_j r_j + t],   joint_j = p_j + t                      [Loper et al. 2015, SMPL, eqs. 3-4]
//
// L_j are the joints' rotations relative to their parents, r_j the rest joints, t the translation. So the body turns
// about its pelvis, where that stands in the rest pose, and the translation is added last. With cotangents G_j of A_j's
// rotation part, g_j of its translation and h_j of the joint,
//
//   d_R_j = G_j − g_j r_jᵀ,  d_p_j = g_j + h_j,  d_t = Σ_j d_p_j,  and then from the last joint to the first
//   d_L_j += R_qᵀ d_R_j,  d_R_q += d_R_j L_jᵀ + d_p_j (r_j − r_q)ᵀ,  d_p_q += d_p_j
//
// and, with whole d_p,
//
//   d_r_j += R_qᵀ d_p_j − R_jᵀ g_j,  d_r_q −= R_qᵀ d_p_j;     d_r_0 += d_p_0 − R_0ᵀ g_0 for the root.
//
// Both directions run in double, for float too: a chain of 55 joints costs nothing beside the points that follow it,
// and its rounding would be the same for all points of a limb.
#pragma once

#include <span>
#include <vector>

#include "autodiff/tape.h"
#include "body/body_model.h"
#include "body/pose.h"

namespace hsi4d {

/// A skeleton in the poses of T frames, on the tape.
/// Frames are independent of each other; joint j of frame t is row J t + j.
template <class S>
struct PosedSkeleton {
  Var<S> transforms;  ///< [T·J,12] posed_from_rest, rows [3,4]: rotation part and metres
  Var<S> joints;      ///< [T·J,3] metres, world
};

/// The transforms and joints of a skeleton, as above.
///
/// @param rotations    [T·J,9] rotation matrices relative to the parent, row-major; row 0 of a frame is global_orient
/// @param transl       [T,3] metres, world
/// @param parents      [J], −1 for joint 0, and else smaller than the joint's own number
/// @param rest_joints  [J,3] metres, rest pose
/// Adjoint: rotations (as functions of nine free numbers each), transl. The rest joints are constants.
/// Throws InternalError when shapes differ or parents is no such tree.
template <class S>
PosedSkeleton<S> kinematic_chain(Var<S> rotations, Var<S> transl, std::vector<int> parents,
                                 std::vector<double> rest_joints, Source where = Source::current());

/// As above, with the rest joints [J,3], which all frames share, on the tape too: they follow the body's shape.
///
/// Adjoint: rotations, transl, rest_joints.
template <class S>
PosedSkeleton<S> kinematic_chain(Var<S> rotations, Var<S> transl, std::vector<int> parents, Var<S> rest_joints,
                                 Source where = Source::current());

/// A skeleton in a pose, untaped.
struct PosedJoints {
  std::vector<double> transforms;  ///< [J,12] posed_from_rest, rows [3,4]
  std::vector<double> joints;      ///< [J,3] metres, world
};

/// As kinematic_chain of the rotations exp(axis_angle), in double.
///
/// Throws InternalError when the sizes differ or parents is no tree as above.
PosedJoints pose_skeleton(std::span<const int> parents, std::span<const double> rest_joints, const BodyPose& pose);
PosedJoints pose_skeleton(const BodyModel& body, const BodyPose& pose);

/// The posed joints alone, [J,3] metres, world.
std::vector<double> pose_joints(std::span<const int> parents, std::span<const double> rest_joints,
                                const BodyPose& pose);
std::vector<double> pose_joints(const BodyModel& body, const BodyPose& pose);

}  // namespace hsi4d
