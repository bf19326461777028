// Frame 0 of a video whose camera is looked for, and what of it shows the scene.
#pragma once

#include <filesystem>
#include <string>

#include "core/image.h"

namespace hsi4d {

/// A picture and what of it counts.
struct FirstPicture {
  std::string place;  ///< which it is, for messages
  std::string name;   ///< of its masks: that of the file, or "0000.png" of a video
  Image color;        ///< [3,H,W]
  Image weight;       ///< [1,H,W], 1 where the scene is seen, else 0; empty: everywhere
};

/// Reads a picture, or the first frame of a folder of frames or of a video.
/// Throws as FrameSource, VideoReader and read_image; DataError naming the file for a picture without colours or with
/// numbers that are not finite.
FirstPicture read_first_picture(const std::filesystem::path& path);

/// Leaves out what masks show: people and objects, which are not of the scene. Of each thing in `folder` the mask of
/// the picture's name in its folder (human/0000.png), the first frame of its video (human.mp4), or the one picture
/// (human.png).
/// Throws UserError naming the folder where nothing in it is a mask of the picture, or where nothing is left; DataError
/// for a mask of another size, and as read_mask_image.
void leave_out_masks(const std::filesystem::path& folder, FirstPicture& picture);

}  // namespace hsi4d
