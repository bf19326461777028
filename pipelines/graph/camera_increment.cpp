#include "pipelines/graph/camera_increment.h"

#include <algorithm>

#include "core/rigid.h"
#include "splat/limits.h"

namespace hsi4d {

namespace {

/// Median camera z of the Gaussians whose centres are in the image, metres; 1 where there are none.
double median_depth(const Gaussians& scene, const Camera& camera) {
  const View<double> view = view_of<double>(camera, scene.origin_world);
  std::vector<double> depths;
  for (Index i = 0; i < scene.count(); ++i) {
    const Vector3<double> p =
        point_in_view(view, Vector3<double>(Vector3<float>(scene.means.data() + 3 * i).cast<double>()));
    if (!(p[2] > kNear)) continue;
    const Vector2<double> pixel = project_point(camera, p);
    if (pixel[0] >= 0 && pixel[0] < camera.width && pixel[1] >= 0 && pixel[1] < camera.height) depths.push_back(p[2]);
  }
  if (depths.empty()) return 1;
  const auto middle = depths.begin() + static_cast<std::ptrdiff_t>(depths.size() / 2);
  std::nth_element(depths.begin(), middle, depths.end());
  return *middle;
}

}  // namespace

Matrix6<double> camera_from_increment(CameraIncrement increment, const Camera& camera, const Gaussians& scene) {
  Rigid<double> frame;
  if (increment == CameraIncrement::kWorld) frame = camera.camera_from_world;
  if (increment == CameraIncrement::kScene) frame.translation = {0, 0, median_depth(scene, camera)};
  return se3_adjoint_matrix(frame);
}

}  // namespace hsi4d
