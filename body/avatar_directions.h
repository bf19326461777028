// How an avatar follows the shape of the body that it was made on.
#pragma once

#include <span>
#include <vector>

#include "body/avatar.h"
#include "body/smplx_file.h"

namespace hsi4d {

/// Directions of an avatar's shape: what a unit of each beta adds in the rest pose. Sizes, quaternions and weights of
/// Gaussians stay.
struct AvatarDirections {
  Index betas = 0;             ///< B
  std::vector<double> means;   ///< [3N,B] metres
  std::vector<double> joints;  ///< [3J,B] metres
};

/// A Gaussian follows the place of the body's surface that is nearest to it in the rest pose.
///
/// @param body   in its layout, of as many joints as the avatar
/// @param betas  in which the avatar was made, as many as the body has
/// Throws InternalError when sizes differ; DataError as rest_body.
AvatarDirections avatar_directions(const Avatar& avatar, const SmplxModel& body, std::span<const double> betas);

/// The avatar with these betas more. Throws InternalError when sizes differ.
void add_betas(const AvatarDirections& shape, std::span<const double> betas, Avatar& avatar);

}  // namespace hsi4d
