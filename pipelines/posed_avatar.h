// An avatar in a pose, as Gaussians to render.
#pragma once

#include "body/avatar.h"
#include "pipelines/scene_render.h"

namespace hsi4d {

/// The avatar's Gaussians in the rest pose. Colours become harmonics of degree 0.
/// Throws InternalError as check_sizes.
Gaussians rest_gaussians(const Avatar& avatar);

/// The avatar's Gaussians with the blended transform of each, Σ_j w_nj A_j, in double.
///
/// Throws InternalError when pose and avatar differ in their joints.
PosedGaussians posed_avatar(const Avatar& avatar, const BodyPose& pose);

/// All rows of `parts`, one part after the other; identity transforms where a part has none and another has some.
/// Errors as those of concatenated in splat/gaussians.h.
PosedGaussians concatenated(std::span<const PosedGaussians> parts);

}  // namespace hsi4d
