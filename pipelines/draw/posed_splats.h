// Gaussians on a tape, put where they are seen: those of the scene, of a rigid object, of a human.
#pragma once

#include <vector>

#include "body/avatar.h"
#include "body/color_net.h"
#include "body/kinematics.h"
#include "splat/render/render.h"

namespace hsi4d {

/// The numbers of N Gaussians on a tape, as files hold them.
template <class S>
struct GaussianVars {
  Var<S> means;           ///< [N,3] metres
  Var<S> quats;           ///< [N,4] wxyz, raw
  Var<S> log_scales;      ///< [N,3]
  Var<S> opacity_logits;  ///< [N,1]
  Var<S> colors;          ///< [N,3K] harmonics; of a human [N,3] colours
};

/// The scene: it stays where it is.
/// @param xi  [1,6] update of the view's camera, from which the harmonics are seen
/// Adjoint: all numbers, xi.
template <class S>
SplatInputs<S> standing_splats(const GaussianVars<S>& scene, Var<S> xi, const SplatView& view);

/// A rigid object: x_world = R x + t; its harmonics turn along.
/// @param rotation  [1,9] rows of R
/// @param transl    [1,3] metres, world
/// Adjoint: all numbers, rotation, transl, xi.
template <class S>
SplatInputs<S> rigid_splats(const GaussianVars<S>& object, Var<S> rotation, Var<S> transl, Var<S> xi,
                            const SplatView& view);

/// The same, by the rows of a transform [1,12] that may scale too.
/// @param turn  [1,12] without the scale: harmonics turn by its linear part
/// Adjoint: all numbers, both transforms, xi.
template <class S>
SplatInputs<S> moved_splats(const GaussianVars<S>& object, Var<S> transform, Var<S> turn, Var<S> xi,
                            const SplatView& view);

/// [1,12], the rows of [R | t], of rotation [1,9] and translation [1,3]. Adjoint: both.
template <class S>
Var<S> rigid_rows(Var<S> rotation, Var<S> translation);

/// What a human's colours follow beside the avatar's own.
template <class S>
struct HumanColors {
  ColorNetVars<S> net;
  std::vector<int> code_joints;
  Var<S> camera_center;  ///< [1,3] metres, world; empty for a network without direction of view
};

/// A human in a pose: linear blend skinning of rest-pose Gaussians, axes by the blended linear map (row D2).
/// @param human      the avatar's numbers
/// @param rotations  [J,9] of the joints
/// @param skeleton   kinematic_chain of them
/// @param colors     null: the avatar's own
/// Adjoint: all numbers, rotations, the skeleton, the network's numbers, the camera's centre.
template <class S>
SplatInputs<S> skinned_splats(const GaussianVars<S>& human, Var<S> rotations, const PosedSkeleton<S>& skeleton,
                              const Avatar& avatar, const HumanColors<S>* colors = nullptr);
/// As above, with the skeleton that the rotations and transl [1,3] (metres, world) give.
template <class S>
SplatInputs<S> skinned_splats(const GaussianVars<S>& human, Var<S> rotations, Var<S> transl, const Avatar& avatar,
                              const HumanColors<S>* colors = nullptr);

/// All rows of several parts, one after the other.
template <class S>
SplatInputs<S> stacked_splats(const std::vector<SplatInputs<S>>& parts);

}  // namespace hsi4d
