// Somebody, or something, that stands on level ground.
#pragma once

#include "body/avatar.h"
#include "pipelines/input/state.h"
#include "splat/gaussians.h"

namespace hsi4d {

/// Where something stands, and which way it is turned.
struct StandingPlace {
  double x = 0, y = 0;     ///< metres
  double heading_deg = 0;  ///< counterclockwise from +x, seen from above
  double ground = 0;       ///< z of the ground, metres
};

/// An upright person with the arms down, pelvis over the place, looking along the heading; the lowest Gaussian's centre
/// is on the ground.
/// @param avatar  in the SMPL-X layout, at rest y up and looking along z
BodyPose standing_pose(const Avatar& avatar, const StandingPlace& place);

/// An object as its file has it, turned about z: its centroid over the place, its lowest Gaussian's centre on the
/// ground.
/// @param object  relative to the centroid of its means
ObjectPose standing_object(const Gaussians& object, const StandingPlace& place);

}  // namespace hsi4d
