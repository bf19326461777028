#include "pipelines/draw/standing.h"

#include <algorithm>
#include <limits>

#include "body/body_model.h"
#include "body/motion_edit.h"
#include "core/angles.h"
#include "core/check.h"
#include "core/rotation.h"
#include "pipelines/draw/posed_avatar.h"

namespace hsi4d {

namespace {

/// z of the lowest centre of moved Gaussians.
double lowest_of(const PosedGaussians& posed) {
  const Gaussians& g = posed.gaussians;
  double lowest = std::numeric_limits<double>::infinity();
  for (Index i = 0; i < g.count(); ++i) {
    const Vector3<double> mean = Vector3<float>(g.means.data() + 3 * i).cast<double>() + g.origin_world;
    const double* const row = posed.transforms.data() + 12 * i + 8;  // z of the rows [3,4]
    lowest = std::min(lowest, row[0] * mean[0] + row[1] * mean[1] + row[2] * mean[2] + row[3]);
  }
  return lowest;
}

}  // namespace

BodyPose standing_pose(const Avatar& avatar, const StandingPlace& place) {
  constexpr double kArmsDown = 68;  // degrees about the axes of the rest pose, where arms are stretched out
  BodyPose pose = rest_pose(avatar.joint_count());
  pose.set_rotation(smplx_joint("left_shoulder"), Vector3<double>(0, 0, -kArmsDown) * kDegree);
  pose.set_rotation(smplx_joint("right_shoulder"), Vector3<double>(0, 0, kArmsDown) * kDegree);
  // y up to z up: what looked along z looks along −y; from there to the heading.
  const Matrix3<double> upright = so3_exp(Vector3<double>(90 * kDegree, 0, 0));
  const Matrix3<double> turn = so3_exp(Vector3<double>(0, 0, (place.heading_deg + 90) * kDegree));
  pose.set_rotation(0, so3_log(Matrix3<double>(turn * upright)));
  const Vector3<double> pelvis = pelvis_of(avatar.joints);
  pose.transl = Vector3<double>(place.x, place.y, 0) - pelvis;
  pose.transl[2] += place.ground - lowest_of({rest_gaussians(avatar), blended_transforms(avatar, pose)});
  return pose;
}

ObjectPose standing_object(const Gaussians& object, const StandingPlace& place) {
  ObjectPose pose;
  pose.rotation = Vector3<double>(0, 0, place.heading_deg * kDegree);
  pose.translation = Vector3<double>(place.x, place.y, 0);
  pose.translation[2] = place.ground - lowest_of(posed_object(object, pose));
  return pose;
}

}  // namespace hsi4d
