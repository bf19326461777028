#include "pipelines/draw/view_turn.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/angles.h"
#include "core/rotation.h"

namespace hsi4d {

namespace {

/// From each part to the camera, in the part's axes.
std::vector<Vector3<double>> to_camera(const Clip& clip, const SceneState& state) {
  const Matrix3<double>& camera = state.camera_from_world.rotation;
  const Vector3<double> center = -(camera.transpose() * state.camera_from_world.translation);
  std::vector<Vector3<double>> directions;
  for (const ObjectPose& object : state.objects)
    directions.emplace_back(so3_exp(object.rotation).transpose() * (center - object.translation));
  for (std::size_t p = 0; p < clip.people(); ++p) {
    const PosedJoints posed = pose_skeleton(clip.person(p).avatar, state.person(p));
    for (std::size_t j = 0; j < posed.joints.size() / 3; ++j) {
      Matrix3<double> world_from_joint;
      for (std::size_t i = 0; i < 9; ++i)
        world_from_joint(static_cast<Index>(i / 3), static_cast<Index>(i % 3)) =
            posed.transforms[12 * j + 4 * (i / 3) + i % 3];
      directions.emplace_back(world_from_joint.transpose() * (center - Vector3<double>(posed.joints.data() + 3 * j)));
    }
  }
  return directions;
}

}  // namespace

double view_turn_deg(const Clip& clip, const SceneState& before, const SceneState& after) {
  const std::vector<Vector3<double>> a = to_camera(clip, before), b = to_camera(clip, after);
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i)
    largest = std::max(largest, std::atan2(cross(a[i], b[i]).norm(), a[i].dot(b[i])));
  return largest / kDegree;
}

}  // namespace hsi4d
