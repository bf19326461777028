// Where the ground is and which way is up in a scene whose world is anybody's: x ↦ s R x + t to a world with z up, the
// ground at z = 0, in metres.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "core/camera.h"
#include "core/image.h"
#include "pipelines/photos/alignment.h"
#include "splat/gaussians.h"

namespace hsi4d {

/// The plane { x : up · x = height } that a scene stands on.
struct GroundPlane {
  Vector3<double> up = Vector3<double>::UnitZ();  ///< unit
  double height = 0;                              ///< of the plane along `up`
  double tolerance = 0;                           ///< how far off points of it may be
  double share = 0;                               ///< of all points that are within
  double below = 0;                               ///< share of points that are under it
};

/// At least this share of the points lies on a ground, and at most this one under it.
inline constexpr double kLeastGroundShare = 0.04, kMostBelowGround = 0.1;

/// The mean of the cameras' up vectors, unit. Throws UserError where they cancel: no camera is held upright on average.
Vector3<double> up_of(const std::vector<Camera>& cameras);

/// The ground under points: of planes within 35 degrees of level through three of them [RANSAC: Fischler and Bolles
/// 1981], the one with most points on it less those under it; then the plane of least squares through its points, again
/// and again. A function of the arguments alone.
///
/// @param up      a guess, unit: cameras' mean, or what somebody says
/// Throws UserError in words where no plane has kLeastGroundShare: nothing level, or too few points.
GroundPlane find_ground(std::span<const Vector3<double>> points, const Vector3<double>& up);

/// Centres of Gaussians of opacity above ½: of those that surfaces are made of.
std::vector<Vector3<double>> solid_points(const Gaussians& gaussians);

/// Takes `up` to z by the smallest turn, the ground to z = 0, lengths to metres, and the point of the ground under
/// `middle` to the origin.
Similarity alignment(const GroundPlane& ground, double scale, const Vector3<double>& middle);

/// Height of a point over the ground, in the units of its world.
double height_over(const GroundPlane& ground, const Vector3<double>& point);

/// Draws a grid of metres, up to 5 m around the origin, at z = 0 over a picture: bright where nothing is before it.
/// @param image  [3,H,W]; @param depth  [H,W], camera z, 0: nothing
void draw_ground_grid(const Camera& camera, std::span<const double> depth, Image& image);

}  // namespace hsi4d
