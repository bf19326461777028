// A camera that stands still, from keypoints of a person who stands or sits on level ground in most frames.
#pragma once

#include <optional>
#include <vector>

#include "body/avatar.h"
#include "core/camera.h"
#include "pipelines/input/keypoints.h"

namespace hsi4d {

/// The camera stands over the origin and looks along y; x is right, z up, the ground at z = 0.
struct PersonCamera {
  Camera camera;
  double height = 0;     ///< metres above the ground
  double pitch_deg = 0;  ///< how far it looks down
  /// Share of the points, ankles aside, that a person of the avatar's size who stands or sits would show within 8 % of
  /// the person's height in the image.
  double agreeing = 0;
  /// Where the person is, by frame; none: the ankles were not found, or not on the ground within a depth of 60 m.
  std::vector<std::optional<Vector2<double>>> places;
};

/// The distance along the ground from the camera that nine of ten frames with a place do not exceed, so that few wrong
/// ankles do not count. 0 without places.
double far_distance(const PersonCamera& found);

/// A focal length for pictures of which nothing is known, pixels: their diagonal, as estimators of bodies assume.
double usual_focal_length(int width, int height);

/// Height and pitch of a camera without roll: those with which a person who stands, or sits with an upright back, and
/// whose ankles are where they were found, has eyes, shoulders, hips and knees where they were found, in most frames (a
/// robust cost, by exhaustive search from 0.2 to 6 m and from 40 degrees up to 80 down, then halving steps). A person
/// at one distance does not tell height from pitch; then the height is near 1.5 m, as a hand holds a camera.
///
/// @param avatar      in the SMPL-X layout; its size is the person's
/// @param intrinsics  size, focal lengths and principal point
/// @param height      metres, where it is known
/// @param file        what messages call the keypoints
/// Throws DataError where no frame shows both ankles and two other pairs.
PersonCamera camera_of_person(const Keypoints& keypoints, const Avatar& avatar, const Camera& intrinsics,
                              std::optional<double> height, const std::string& file);

/// The same of a camera that is known, in a world with z up and the ground at z = 0. Throws as camera_of_person.
PersonCamera placed_person(const Keypoints& keypoints, const Avatar& avatar, const Camera& camera,
                           const std::string& file);

}  // namespace hsi4d
