// A camera from places that were picked in its picture and whose points in the world are known, some of them wrongly.
//
//   triples of picks → up to eight poses each [Grunert 1841, as in Haralick et al. 1994, section 3.1] → the pose with
//   the least Σ min(e², tolerance²) over all picks, e the distance in the picture [MSAC: Torr and Zisserman 2000]; of
//   the best of these, least squares over the picks within the tolerance (Gauss and Newton, damped), until these stay
//   the same; and the best of what they come to [locally optimised: Chum, Matas and Kittler 2003]
//
// All triples are tried where they are few. Without a focal length, one after the other of a geometric row is tried
// so, and least squares finds it with the pose [as Sattler et al. 2014 sample it]. A function of its arguments alone.
#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "core/camera.h"

namespace hsi4d {

/// A place in the picture and what is there.
struct PickedPoint {
  Vector2<double> pixel;        ///< u, v
  Vector3<double> point_world;  ///< metres
};

/// The fewest picks that a pose, and a pose and a focal length are found from.
inline constexpr Index kFewestPicks = 4, kFewestPicksForFocal = 6;

/// What picks say.
struct PickedCamera {
  Camera camera;
  std::vector<double> errors_px;  ///< of each pick; infinite behind the camera
  double tolerance_px = 0;        ///< up to which a pick counts as right
  Index agreeing = 0;             ///< picks that do
  double rms_px = 0;              ///< of these
  /// Standard deviations that the errors of the agreeing picks give camera and focal length.
  double position_m = 0, rotation_deg = 0, focal_share = 0;
};

/// Finds the camera.
///
/// @param picks       points of the world and where the picture shows them
/// @param intrinsics  size and principal point; fx, fy where has_focal, else only their ratio counts
/// @param has_focal   the focal length is known
/// @param tolerance   pixels
/// @param where       begins messages: the file of the picks
/// Throws UserError in words: too few picks, points on a line, fewer than kFewestPicks (…ForFocal) that agree with any
/// camera, points that leave the focal length open.
PickedCamera camera_from_picks(std::span<const PickedPoint> picks, const Camera& intrinsics, bool has_focal,
                               double tolerance, const std::string& where);

/// Cameras of three points, exact where they have one: camera_from_world of each real root.
/// @param rays    unit, camera frame
/// @param points  metres, world
std::vector<Rigid<double>> poses_of_three(const std::array<Vector3<double>, 3>& rays,
                                          const std::array<Vector3<double>, 3>& points);

}  // namespace hsi4d
