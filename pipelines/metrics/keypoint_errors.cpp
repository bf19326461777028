#include "pipelines/metrics/keypoint_errors.h"

#include <cmath>

#include "body/kinematics.h"

namespace hsi4d {

namespace {

/// Where the camera sees a point of the body, pixels.
Vector2<double> seen_point(const KeypointJoints& point, const std::vector<double>& joints, const Camera& camera) {
  Vector3<double> place = Vector3<double>::Zero();
  for (const auto& [joint, weight] : point) place += weight * Vector3<double>(joints.data() + 3 * joint);
  const Vector3<double> seen = camera.camera_from_world.rotation * place + camera.camera_from_world.translation;
  if (!(seen[2] > 0)) return Vector2<double>::Constant(std::nan(""));
  return project_point(camera, seen);
}

MetricValues errors_of(const Clip& clip, const std::vector<Keypoint>& found, const SceneState& state) {
  const std::vector<double> joints = pose_joints(clip.avatar.parents, clip.avatar.joints, state.body);
  Camera camera = clip.camera;
  camera.camera_from_world = state.camera_from_world;
  double sum = 0;
  int count = 0;
  for (std::size_t k = 0; k < found.size(); ++k) {
    if (found[k].confidence < kFoundConfidence) continue;
    const Vector2<double> target(found[k].x * camera.width, found[k].y * camera.height);
    sum += (seen_point(clip.keypoints->joints[k], joints, camera) - target).norm();
    ++count;
  }
  if (count == 0 || !std::isfinite(sum)) return {};
  return {{"keypoints_px", sum / count}};
}

}  // namespace

std::vector<MetricValues> keypoint_errors_by_frame(const Clip& clip, const std::vector<SceneState>& states) {
  std::vector<MetricValues> all(states.size());
  for (std::size_t t = 0; clip.keypoints && t < states.size(); ++t)
    all[t] = errors_of(clip, clip.keypoints->frames.at(t), states[t]);
  return all;
}

}  // namespace hsi4d
