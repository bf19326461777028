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

Vector2<double> target_of(const Keypoint& found, const Camera& camera) {
  return {found.x * camera.width, found.y * camera.height};
}

/// The longer side of the box around the points that were found, pixels.
double extent_of(const std::vector<Keypoint>& found, const Camera& camera) {
  Vector2<double> low = Vector2<double>::Constant(INFINITY), high = -low;
  for (const Keypoint& point : found) {
    if (point.confidence < kFoundConfidence) continue;
    low = low.cwiseMin(target_of(point, camera));
    high = high.cwiseMax(target_of(point, camera));
  }
  return (high - low).maxCoeff();
}

MetricValues errors_of(const Clip& clip, std::size_t person, const std::vector<Keypoint>& found,
                       const SceneState& state) {
  const Avatar& avatar = clip.person(person).avatar;
  const std::vector<double> joints = pose_joints(avatar.parents, avatar.joints, state.body);
  Camera camera = clip.camera;
  camera.camera_from_world = state.camera_from_world;
  const double extent = extent_of(found, camera);
  double sum = 0, near = 0, count = 0;
  for (std::size_t k = 0; k < found.size(); ++k) {
    if (found[k].confidence < kFoundConfidence) continue;
    const double distance =
        (seen_point(clip.person(person).keypoints->joints[k], joints, camera) - target_of(found[k], camera)).norm();
    sum += distance;
    near += distance < kPckShare * extent ? 1 : 0;
    ++count;
  }
  if (count == 0 || !std::isfinite(sum)) return {};
  MetricValues errors = {{"keypoints_px", sum / count}};
  if (extent > 0) errors.emplace_back("keypoints_pck", near / count);
  return errors;
}

}  // namespace

std::vector<MetricValues> keypoint_errors_by_frame(const Clip& clip, const std::vector<SceneState>& states,
                                                   std::size_t person) {
  std::vector<MetricValues> all(states.size());
  const std::optional<Keypoints>& keypoints = clip.person(person).keypoints;
  for (std::size_t t = 0; keypoints && t < states.size(); ++t)
    all[t] = errors_of(clip, person, keypoints->frames.at(t), states[t]);
  return all;
}

}  // namespace hsi4d
