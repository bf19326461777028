#include "core/camera_places.h"

#include <cmath>
#include <numbers>

namespace hsi4d {

Camera camera_at(const Vector3<double>& eye, const Vector3<double>& target, double focal_share, int size_px) {
  Camera camera;
  camera.width = camera.height = size_px;
  camera.fx = camera.fy = focal_share * size_px;
  camera.cx = camera.cy = 0.5 * size_px;
  camera.camera_from_world = look_at(eye, target);
  return camera;
}

std::vector<Camera> cameras_around(const Vector3<double>& center, double radius, Index count, int size_px,
                                   double lowest) {
  constexpr double kFocal = 1.2, kFill = 0.8;  // of the picture's width
  const double distance = radius * 2 * kFocal / kFill;
  const double golden = std::numbers::pi * (3 - std::sqrt(5.0));
  std::vector<Camera> cameras;
  for (Index k = 0; k < count; ++k) {
    const double z = 1 - (1 - lowest) * (static_cast<double>(k) + 0.5) / static_cast<double>(count);
    const double across = std::sqrt(1 - z * z), angle = golden * static_cast<double>(k);
    const Vector3<double> way(across * std::cos(angle), across * std::sin(angle), z);
    cameras.push_back(camera_at(center + distance * way, center, kFocal, size_px));
  }
  return cameras;
}

std::vector<Camera> cameras_to_all_sides(const Vector3<double>& eye, int size_px) {
  std::vector<Camera> cameras;
  for (Index axis = 0; axis < 3; ++axis) {
    for (const double sign : {1.0, -1.0}) {
      Vector3<double> target = eye;
      target[axis] += sign;
      cameras.push_back(camera_at(eye, target, 0.5, size_px));
    }
  }
  return cameras;
}

}  // namespace hsi4d
