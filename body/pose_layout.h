// Poses of other body models as poses of SMPL-X.
#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "body/pose.h"

namespace hsi4d {

/// `joints` joints that follow each other, from joint `from` of one layout on, are those from `to` on of SMPL-X.
struct PoseRun {
  Index from, to, joints;
};

/// Where the joints of a pose of that many joints stand in SMPL-X: 55 (SMPL-X); 52 (SMPL-H: body and hands, no jaw, no
/// eyes); 22 to 24 (SMPL: the body; its two hand joints, 22 and 23, are left out, for they have no place there). Empty
/// for another number.
std::vector<PoseRun> smplx_runs(Index joints);

/// A pose of SMPL-X from the axis-angle vectors of one of these models; the joints that it has not are not turned.
///
/// @param axis_angle  [joints,3] radians
/// @param source      what messages call it
/// Throws DataError when it has another number of joints.
BodyPose smplx_pose(std::span<const double> axis_angle, std::string_view source);

}  // namespace hsi4d
