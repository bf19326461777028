// Small views of real Gaussians: the data folder beside the source tree, where there is one.
#pragma once

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include "splat/io_ply.h"
#include "tests/support/splat_scenes.h"

namespace hsi4d::test {

/// A view from outside towards the middle of a file's Gaussians.
struct RealView {
  std::string file;
  Vector3<double> from;  ///< direction of the eye as seen from the middle
  double distance;       ///< of the eye, in median distances of the Gaussians from the middle
  double zoom;           ///< focal length over width
};

inline std::vector<RealView> real_views() {
  return {{"playbot_object_robot.ply", {1, -0.6, 1}, 3, 5},
          {"playbot_scene_ground.ply", {1, -0.8, 0.4}, 1.5, 8},
          {"garden_sfm_init.ply", {0.3, -0.5, -1}, 2, 18}};
}

/// Reads the Gaussians whose centres lie in the view or within a tenth of it, 96×64 pixels. False without the file.
inline bool real_scene(const RealView& view, SplatScene& scene) {
  const std::string path = std::string(HSI4D_SOURCE_DIR) + "/../shared/data/splats/" + view.file;
  if (!std::filesystem::exists(path)) return false;
  const Gaussians all = read_ply(path).gaussians;
  const auto point = [&](Index n) {
    const float* m = all.means.data() + 3 * n;
    return Vector3<double>(m[0], m[1], m[2]);
  };
  const auto median = [](std::vector<double> x) {
    std::nth_element(x.begin(), x.begin() + static_cast<std::ptrdiff_t>(x.size() / 2), x.end());
    return x[x.size() / 2];
  };
  Vector3<double> middle;
  std::vector<double> numbers(static_cast<std::size_t>(all.count()));
  for (int i = 0; i < 3; ++i) {
    for (Index n = 0; n < all.count(); ++n) numbers[static_cast<std::size_t>(n)] = point(n)[i];
    middle[i] = median(numbers);
  }
  for (Index n = 0; n < all.count(); ++n) numbers[static_cast<std::size_t>(n)] = (point(n) - middle).norm();
  const double distance = view.distance * median(numbers);
  scene = {};
  scene.name = view.file;
  scene.sh_degree = all.sh_degree;
  scene.camera = plain_camera({96, 64});
  scene.camera.fx = scene.camera.fy = view.zoom * scene.camera.width;
  scene.camera.camera_from_world = look_at(middle + view.from.normalized() * distance, middle, {0, -1, 0});
  scene.background = {0.1f, 0.2f, 0.3f};
  const auto width = static_cast<std::ptrdiff_t>(3 * all.sh_coefficients());
  for (Index n = 0; n < all.count(); ++n) {
    const Vector3<double> p = transform_point(scene.camera.camera_from_world, point(n));
    const double u = scene.camera.fx * p[0] / p[2], v = scene.camera.fy * p[1] / p[2];
    if (!(p[2] > 0) || std::abs(u) > 0.55 * scene.camera.width || std::abs(v) > 0.55 * scene.camera.height) continue;
    const auto copy = [n](const std::vector<float>& from, std::vector<float>& to, std::ptrdiff_t size) {
      to.insert(to.end(), from.begin() + n * size, from.begin() + (n + 1) * size);
    };
    copy(all.means, scene.means, 3);
    copy(all.quats, scene.quats, 4);
    copy(all.log_scales, scene.log_scales, 3);
    copy(all.opacity_logits, scene.opacity_logits, 1);
    copy(all.sh, scene.sh, width);
  }
  return true;
}

}  // namespace hsi4d::test
