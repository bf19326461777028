// Where cameras stand that are to see something from all sides.
#pragma once

#include <vector>

#include "core/camera.h"

namespace hsi4d {

/// A camera of a square picture that looks from `eye` to `target`, its top towards +z.
/// @param focal_share  focal length, of the picture's width
Camera camera_at(const Vector3<double>& eye, const Vector3<double>& target, double focal_share, int size_px);

/// Lowest heights of cameras on a unit sphere: all of it, or what somebody who walks around a thing on the ground sees.
inline constexpr double kAllSides = -1, kMostSides = -0.6;

/// Cameras on a sphere around a point, evenly [Fibonacci lattice], looking at it.
/// @param radius  of what is to be in the picture, metres
/// @param lowest  kAllSides, kMostSides
std::vector<Camera> cameras_around(const Vector3<double>& center, double radius, Index count, int size_px,
                                   double lowest);

/// Six cameras at a place that see all around, 90 degrees each.
std::vector<Camera> cameras_to_all_sides(const Vector3<double>& eye, int size_px);

}  // namespace hsi4d
