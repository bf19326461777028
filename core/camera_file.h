// Cameras in JSON files.
//
//   {"width", "height", "fx", "fy", "cx", "cy", "world_to_camera": 4×4 rows}            one camera
//   {"format": "hsi4d cameras", "version": 1, "cameras": [{...}, ...]}                 several
//   {"w", "h", "fl_x", "fl_y", "cx", "cy", "frames": [{"transform_matrix": 4×4, ...}]}  nerfstudio's transforms.json
//
// The first two are used as given. Unknown keys are errors in them and passed over in the third, unless they say that a
// picture is of no pinhole (a lens that bends, a panorama, a rolling shutter): these are refused. Its intrinsics may
// also stand in a frame; its matrices take OpenGL camera axes (y up, z backward) to the world.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "core/camera.h"
#include "core/lens.h"

namespace hsi4d {

/// Camera `frame` of a file of any of the three kinds, counted from 0 in the file's order.
///
/// Throws UserError naming file, line, JSON pointer, value and what is allowed: a file that cannot be read, is not
/// such JSON, or holds cameras that check_camera refuses or that distort; a frame that is not there.
Camera read_camera(const std::string& path, int frame = 0);

/// All cameras of a file of any of the three kinds. Errors as read_camera.
std::vector<Camera> read_cameras(const std::string& path);

/// A camera, and the picture that it took.
struct PictureCamera {
  Camera camera;
  std::string picture;                ///< nerfstudio's file_path; empty: the file names none
  std::string mask = {}, depth = {};  ///< its mask_path and depth_file_path; empty: none
  Lens lens = {};                     ///< of read_photo_cameras
  double angle_x = 0;  ///< radians, of read_photo_cameras: the horizontal field of view where there is no fl_x, which
                       ///< is then 0, and so is what else the file does not say: width, height, fy, cx, cy
  double angle_y = 0;  ///< likewise the vertical one
};

/// As read_cameras, with what the file says of their pictures. Nerfstudio's entries are in any order.
std::vector<PictureCamera> read_picture_cameras(const std::string& path);

/// As read_picture_cameras, for a reader of the pictures, who can straighten them and knows their size: nerfstudio's
/// k1, k2, k3, p1, p2 are taken, and so is `camera_angle_x` in place of intrinsics, as Blender's exporters write it.
std::vector<PictureCamera> read_photo_cameras(const std::string& path);

/// As read_photo_cameras, of text in memory.
std::vector<PictureCamera> decode_photo_cameras(const std::string& text, const std::string& name);

/// As read_cameras, of text in memory.
/// @param name  what error messages call it
std::vector<Camera> decode_cameras(const std::string& text, const std::string& name);

/// Writes one camera, so that reading gives the same bits; in one step. Throws UserError for one that check_camera
/// refuses, and when the path cannot be written.
void write_camera(const std::string& path, const Camera& camera);

/// Writes a list of cameras. As write_camera.
void write_cameras(const std::string& path, std::span<const Camera> cameras);

}  // namespace hsi4d
