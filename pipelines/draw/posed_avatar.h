// An avatar or an object in a pose, as Gaussians to render.
#pragma once

#include "body/avatar.h"
#include "pipelines/draw/image_of_scene.h"
#include "pipelines/input/state.h"

namespace hsi4d {

/// The avatar's Gaussians in the rest pose. Colours, the avatar's own, become harmonics of degree 0.
/// Throws InternalError as check_sizes.
Gaussians rest_gaussians(const Avatar& avatar);

/// The blended transform of each of the avatar's Gaussians, Σ_j w_nj A_j, rows [3,4]: [N,12], in double. Throws
/// InternalError when pose and avatar differ in their joints.
std::vector<double> blended_transforms(const Avatar& avatar, const BodyPose& pose);

/// The avatar's Gaussians with the blended transform of each, Σ_j w_nj A_j, in double. Colours become harmonics of
/// degree 0: those of the avatar's color net in this pose, where it has one.
///
/// @param center_world  the camera's centre, metres, of which only a color net with a direction of view knows
/// Throws InternalError when pose and avatar differ in their joints, or that centre is needed and null.
PosedGaussians posed_avatar(const Avatar& avatar, const BodyPose& pose, const Vector3<double>* center_world = nullptr);

/// An object's Gaussians, which are relative to the centroid of their means, in the world.
PosedGaussians posed_object(const Gaussians& object, const ObjectPose& pose);

/// All rows of `parts`, one part after the other; identity transforms where a part has none and another has some.
/// Errors as those of concatenated in splat/gaussians.h.
PosedGaussians concatenated(std::span<const PosedGaussians> parts);

}  // namespace hsi4d
