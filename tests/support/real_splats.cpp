#include "tests/support/real_splats.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <utility>

#include "splat/files/io_ply.h"

namespace hsi4d::test {

namespace {

Vector3<double> mean_of(const Gaussians& gaussians, Index n) {
  const float* m = gaussians.means.data() + 3 * n;
  return {m[0], m[1], m[2]};
}

double median(std::vector<double> x) {
  std::nth_element(x.begin(), x.begin() + static_cast<std::ptrdiff_t>(x.size() / 2), x.end());
  return x[x.size() / 2];
}

/// Median of f(n) over the Gaussians.
template <class F>
double median_over(const Gaussians& gaussians, const F& f) {
  std::vector<double> numbers;
  for (Index n = 0; n < gaussians.count(); ++n) numbers.push_back(f(n));
  return median(std::move(numbers));
}

Camera camera_of(const RealView& view, const Gaussians& gaussians) {
  Vector3<double> middle;
  for (int i = 0; i < 3; ++i) middle[i] = median_over(gaussians, [&](Index n) { return mean_of(gaussians, n)[i]; });
  const double typical = median_over(gaussians, [&](Index n) { return (mean_of(gaussians, n) - middle).norm(); });
  Camera camera = plain_camera(view.size);
  camera.fx = camera.fy = view.zoom * camera.width;
  camera.camera_from_world = look_at(middle + view.from.normalized() * (view.distance * typical), middle, {0, -1, 0});
  return camera;
}

bool is_in_view(const Camera& camera, double margin, const Vector3<double>& world) {
  if (margin == std::numeric_limits<double>::infinity()) return true;
  const Vector3<double> p = transform_point(camera.camera_from_world, world);
  return p[2] > 0 && std::abs(camera.fx * p[0] / p[2]) <= (0.5 + margin) * camera.width &&
         std::abs(camera.fy * p[1] / p[2]) <= (0.5 + margin) * camera.height;
}

}  // namespace

RealView cropped_view() { return {"tests/assets/playbot_ground_crop.ply", {1, -0.8, 0.4}, 3, 1.5}; }

std::vector<RealView> close_views() {
  const std::string folder = "../shared/data/splats/";
  return {{folder + "playbot_object_robot.ply", {1, -0.6, 1}, 3, 5},
          {folder + "playbot_scene_ground.ply", {1, -0.8, 0.4}, 1.5, 8},
          {folder + "garden_sfm_init.ply", {0.3, -0.5, -1}, 2, 18}};
}

std::vector<RealView> whole_views() {
  const std::string file = "../shared/data/splats/playbot_scene_ground.ply";
  std::vector<RealView> views;
  for (const auto& [from, distance, zoom] : {std::tuple{Vector3<double>(1, -0.8, 0.4), 1.5, 1.3},
                                             {Vector3<double>(-0.7, -1, -0.7), 1.5, 1.3},
                                             {Vector3<double>(-0.7, -0.6, 0.7), 2.5, 1.0},
                                             {Vector3<double>(0.2, -0.8, -1), 1.0, 1.3}}) {
    views.push_back({file, from, distance, zoom, {640, 480}, std::numeric_limits<double>::infinity()});
  }
  return views;
}

bool real_scene(const RealView& view, SplatScene& scene) {
  const std::string path = std::string(HSI4D_SOURCE_DIR) + "/" + view.file;
  if (!std::filesystem::exists(path)) return false;
  const Gaussians all = read_ply(path).gaussians;
  scene = {};
  scene.name = std::filesystem::path(view.file).filename().string();
  scene.sh_degree = all.sh_degree;
  scene.camera = camera_of(view, all);
  scene.background = {0.1f, 0.2f, 0.3f};
  std::vector<Index> in_view;
  for (Index n = 0; n < all.count(); ++n) {
    if (is_in_view(scene.camera, view.margin, mean_of(all, n))) in_view.push_back(n);
  }
  Gaussians part = selected(all, in_view);
  scene.means = std::move(part.means);
  scene.quats = std::move(part.quats);
  scene.log_scales = std::move(part.log_scales);
  scene.opacity_logits = std::move(part.opacity_logits);
  scene.sh = std::move(part.sh);
  return true;
}

}  // namespace hsi4d::test
