// A camera whose axes are the world's.
#pragma once

#include "splat/view.h"

namespace hsi4d::stress {

/// A camera at the origin with the world's axes as its own: p_camera = p_world. Focal length = width, the principal
/// point in the middle.
inline Camera front_camera(int width, int height) {
  const double w = width;
  return {width, height, w, w, 0.5 * w, 0.5 * height, {}};
}

inline SplatView front_view(int width, int height, const RenderSettings& settings = {}) {
  return {front_camera(width, height), Vector3<double>::Zero(), settings};
}

}  // namespace hsi4d::stress
