// The pose of a body at one moment, as files of motion hold it.
#pragma once

#include <vector>

#include "core/linear.h"
#include "core/types.h"

namespace hsi4d {

/// Root translation and joint rotations in SMPL-X order: row 0 global_orient, 1-21 body, 22 jaw, 23 left eye, 24 right
/// eye, 25-39 left hand, 40-54 right hand.
struct BodyPose {
  Vector3<double> transl = Vector3<double>::Zero();  ///< metres, world
  std::vector<double> axis_angle;                    ///< [J,3] radians, each relative to its parent

  Index joints() const { return static_cast<Index>(axis_angle.size() / 3); }
  Vector3<double> rotation_of(Index joint) const {
    const double* x = axis_angle.data() + 3 * joint;
    return {x[0], x[1], x[2]};
  }
  void set_rotation(Index joint, const Vector3<double>& w) {
    for (Index i = 0; i < 3; ++i) axis_angle[static_cast<std::size_t>(3 * joint + i)] = w[i];
  }
};

/// The rest pose of a body of `joints` joints, at its origin.
inline BodyPose rest_pose(Index joints) {
  BodyPose pose;
  pose.axis_angle.assign(static_cast<std::size_t>(3 * joints), 0.0);
  return pose;
}

}  // namespace hsi4d
