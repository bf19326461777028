// Pictures whose cameras are known: what scenes and objects are made from.
//
// Read from whatever a field's programs write:
//
//   a folder of COLMAP       cameras, images, points3D, as .bin or .txt, in it, in sparse/ or in sparse/0/; its
//   pictures
//                            are in images/, masks of their names in masks/, depths in depths/
//   transforms.json          nerfstudio, instant-ngp and Blender (core/camera_file.h)
//   cameras.json             a list of what INRIA's programs write of their training views
//
// Worlds are as the file has them: metres and up are nobody's promise (`hsi4d align`).
#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include "core/camera.h"
#include "core/image.h"
#include "core/lens.h"

namespace hsi4d {

/// A picture and its camera. Paths are those of files that are there.
struct PosedImage {
  std::string name;             ///< as the file calls it, without folder and ending where it has none
  std::filesystem::path image;  ///< the picture
  std::filesystem::path mask;   ///< what of it counts (core/mask_image.h); empty: all, or its alpha
  std::filesystem::path depth;  ///< camera z; empty: not known
  Camera camera;                ///< of the picture's size; a pinhole, which sees what `lens` bends
  Lens lens;
};

/// A point of a scene, as structure from motion finds it.
struct ColoredPoint {
  Vector3<double> place;                      ///< the world of the cameras
  std::array<float, 3> color = {.5, .5, .5};  ///< 0 to 1
};

/// Pictures of one scene, ordered by name.
struct PosedImages {
  std::filesystem::path file;  ///< what was read, for messages
  std::vector<PosedImage> images;
  std::vector<ColoredPoint> points;  ///< none where the file has none
};

/// Reads cameras and looks for their pictures. What is left out is told in the log: pictures without a camera, cameras
/// without a picture.
///
/// @param path      a folder, or one of the files above
/// @param pictures  the folder of the pictures, where it is not beside the cameras; empty: where the file says
/// Throws UserError naming file and place, all problems at once: nothing that is read, no picture of any camera,
/// masks or depths of some pictures alone, lenses that cannot be straightened, two cameras of one picture; DataError
/// for damaged files.
PosedImages read_posed_images(const std::filesystem::path& path, const std::filesystem::path& pictures = {});

}  // namespace hsi4d
