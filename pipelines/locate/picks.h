// Files of picked places: lines of numbers apart by commas under a line that names them.
//
//   frame_x,frame_y,x,y,z               a place in the frame, pixels, and the point of the scene there, metres
//   frame_x,frame_y,view_x,view_y       the same place in another picture of the scene, whose camera is known
//
// Pixels count from the upper left corner of the picture; the centre of the first pixel is (0.5, 0.5). What follows #
// is a comment.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "pipelines/draw/image_of_scene.h"
#include "pipelines/locate/camera_from_picks.h"

namespace hsi4d {

/// A line of such a file: one of `point_world` and `view_pixel` is there, the same in all lines.
struct Pick {
  int line = 0;  ///< from 1
  Vector2<double> frame_pixel;
  std::optional<Vector3<double>> point_world;
  std::optional<Vector2<double>> view_pixel;
};

/// Reads a file in memory.
/// @param name  what messages call it
/// Throws DataError naming the file and the line: another first line, another count of numbers, one that is not
/// finite, no picks, two of one place in the frame.
std::vector<Pick> decode_picks(const std::string& text, const std::string& name);

/// What picks say of the scene. Those of another picture have the depth at which half of the light of its pixel is
/// stopped (pipelines/draw/median_depth.h).
///
/// @param frame  the camera of the frame, of which only the size counts
/// @param view   the camera of the other picture, and how it is drawn; none: not given
/// Throws UserError naming the file, all lines at once: places outside of the frame or of the view, places where the
/// view sees through, a view that is not given, or given for nothing.
std::vector<PickedPoint> picked_points(const std::vector<Pick>& picks, const Gaussians& scene, const Camera& frame,
                                       const std::optional<SceneView>& view, const std::string& name);

}  // namespace hsi4d
