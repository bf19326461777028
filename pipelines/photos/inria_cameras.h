// cameras.json as INRIA's programs of 3D Gaussian splatting write it: the views that Gaussians were trained with.
//
//   [{"id", "img_name", "width", "height", "position": [x, y, z], "rotation": 3×3 rows, "fx", "fy"}, ...]
//
// position is the camera's centre, rotation takes OpenCV camera axes to the world; the principal point is the middle.
#pragma once

#include <string>
#include <vector>

#include "pipelines/photos/posed_images.h"

namespace hsi4d {

/// Whether a text begins as such a file does: with an array.
bool is_inria_cameras(const std::string& text);

/// The cameras, with the names of their pictures alone.
/// @param name  what messages call the text
/// Throws UserError with all problems: file, line, JSON pointer, value and what is allowed.
std::vector<PosedImage> decode_inria_cameras(const std::string& text, const std::string& name);

}  // namespace hsi4d
