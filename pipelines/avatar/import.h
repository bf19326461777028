// Gaussians of an avatar that another program made, bound to a body model.
#pragma once

#include <string>

#include "body/avatar.h"
#include "splat/gaussians.h"

namespace hsi4d {

/// Farther than this from the body, metres, Gaussians are no clothes or hair of it any more.
inline constexpr double kFarFromBody = 0.15;

/// Of less of the body's area than this, Gaussians that are near it are no human; of less than that, not a whole one.
inline constexpr double kLeastCovered = 0.4, kWellCovered = 0.9;

/// What import_avatar found. Distances of means from the surface, metres.
struct AvatarImport {
  Avatar avatar;
  double mean_distance = 0, largest_distance = 0;
  Index far = 0;            ///< Gaussians beyond kFarFromBody
  double covered = 0;       ///< share of the body's area with a Gaussian within a few centimetres (covered_share)
  bool lost_views = false;  ///< harmonics above degree 0, which an avatar does not hold, were there and not all zero
};

/// The share of a body's area that has a mean near it: in the same cell of a grid of kCoverCell, or in one beside it.
/// Means beyond 100 m are near nothing.
/// @param means  [N,3] metres, rest pose
double covered_share(const std::vector<float>& means, const BodyModel& body);
inline constexpr double kCoverCell = 0.05;  ///< metres

/// Binds Gaussians to a body: each gets the skinning weights of the place of the surface that is nearest to its mean,
/// interpolated in its triangle, the four largest, normalised. Means, quaternions, scales and opacities stay as they
/// are; colours are the harmonics' part of degree 0, from 0 up.
///
/// @param gaussians  in the body's rest pose and frame (see BodyModel), metres
/// @param source     what messages call them
/// Throws DataError when there is none, or more than half of them are beyond kFarFromBody: they are then in another
/// pose, unit or frame; or less than kLeastCovered of the body has some near it; InternalError when sizes do not fit or
/// the body has no surface.
AvatarImport import_avatar(const Gaussians& gaussians, const BodyModel& body, const std::string& source);

}  // namespace hsi4d
