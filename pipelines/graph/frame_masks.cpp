#include "pipelines/graph/frame_masks.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/LU>

#include "core/rotation.h"
#include "splat/limits.h"

namespace hsi4d {

Vector3<double> mask_center(const Image& mask, double threshold) {
  double mass = 0, x_sum = 0, y_sum = 0;
  bool is_seen = false;
  for (int y = 0; y < mask.height(); ++y) {
    const float* row = mask.row(0, y);
    for (int x = 0; x < mask.width(); ++x) {
      const auto m = static_cast<double>(row[x]);
      is_seen = is_seen || m >= threshold;
      mass += m;
      x_sum += m * (x + 0.5);
      y_sum += m * (y + 0.5);
    }
  }
  return is_seen ? Vector3<double>(x_sum / mass, y_sum / mass, mass) : Vector3<double>::Zero();
}

double mean_depth(const Gaussians& object, const ObjectPose& pose, const Rigid<double>& camera_from_world) {
  Vector3<double> sum = Vector3<double>::Zero();
  for (Index i = 0; i < object.count(); ++i) {
    sum += Vector3<float>(object.means.data() + 3 * i).cast<double>();
  }
  const Vector3<double> centre = sum / static_cast<double>(object.count());
  const Vector3<double> world = so3_exp(pose.rotation) * centre + pose.translation;
  return transform_point(camera_from_world, world)[2];
}

double covered_area(const Gaussians& object, const ObjectPose& pose, const Camera& camera) {
  const Rigid<double> world_from_object{so3_exp(pose.rotation), pose.translation};
  Vector2<double> mean = Vector2<double>::Zero();
  Eigen::Matrix2d spread = Eigen::Matrix2d::Zero();
  Index count = 0;
  for (Index i = 0; i < object.count(); ++i) {
    const Vector3<double> place = Vector3<float>(object.means.data() + 3 * i).cast<double>();
    const Vector3<double> p = transform_point(camera.camera_from_world, transform_point(world_from_object, place));
    if (!(p[2] > kNear)) continue;
    const Vector2<double> pixel = project_point(camera, p), from_mean = pixel - mean;
    mean += from_mean / static_cast<double>(++count);
    spread += from_mean * (pixel - mean).transpose();
  }
  if (count == 0) return 0;
  return 4 * std::numbers::pi * std::sqrt(std::max(0.0, spread.determinant())) / static_cast<double>(count);
}

}  // namespace hsi4d
