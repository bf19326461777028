// Cameras placed by rule.
#pragma once

#include <vector>

#include "core/camera.h"
#include "core/types.h"

namespace hsi4d {

/// A sphere of cameras.
struct CameraSphere {
  Vector3<double> center = Vector3<double>::Zero();  ///< metres: what they look at
  double radius = 1;                                 ///< of the ball that fills four fifths of each picture, metres
  Index count = 70;
  int size_px = 512;
  double lowest = -1;  ///< sine of the lowest camera's elevation: −1 is straight below
};

/// Cameras evenly on a sphere [Fibonacci lattice], from the top down, the top of their pictures towards z.
std::vector<Camera> cameras_around(const CameraSphere& sphere);

/// Six cameras at a place that see all around, 90 degrees each.
std::vector<Camera> cameras_to_all_sides(const Vector3<double>& eye, int size_px);

}  // namespace hsi4d
