#include "body/pose_layout.h"

#include <algorithm>
#include <string>

#include "body/body_model.h"
#include "core/check.h"

namespace hsi4d {

std::vector<PoseRun> smplx_runs(Index joints) {
  if (joints == kSmplxJoints) return {{0, 0, kSmplxJoints}};
  if (joints == kSmplhJoints) return {{0, 0, kBodyJoints}, {kBodyJoints, kFirstHandJoint, kSmplhJoints - kBodyJoints}};
  if (joints >= kBodyJoints && joints <= kSmplJoints) return {{0, 0, kBodyJoints}};
  return {};
}

BodyPose smplx_pose(std::span<const double> axis_angle, std::string_view source) {
  const auto runs = smplx_runs(static_cast<Index>(axis_angle.size() / 3));
  if (axis_angle.size() % 3 != 0 || runs.empty()) {
    throw DataError(std::string(source) + ": a pose of " + std::to_string(axis_angle.size()) +
                    " numbers; allowed: 165 (SMPL-X), 156 (SMPL-H), 66, 69 or 72 (SMPL)");
  }
  BodyPose pose = rest_pose(kSmplxJoints);
  for (const PoseRun& run : runs) {
    const auto first = axis_angle.begin() + 3 * run.from;
    std::copy(first, first + 3 * run.joints, pose.axis_angle.begin() + 3 * run.to);
  }
  return pose;
}

}  // namespace hsi4d
