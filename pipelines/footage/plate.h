// The background of a video: what is seen where nobody is, and Gaussians that show it.
#pragma once

#include "core/camera.h"
#include "core/image.h"
#include "pipelines/input/clip.h"
#include "splat/gaussians.h"
#include "splat/render_settings.h"

namespace hsi4d {

/// A background, and how far the video supports it.
struct Plate {
  Image image;      ///< [3,H,W]
  double seen = 0;  ///< share of the pixels that are seen; the others are filled from around them
  /// How far edges of the frames are from where their median has them, across them, where no mask is: the median of a
  /// frame, and of the frames the ninth of ten. Light that changes counts too.
  double unrest_px = 0;
  bool is_still = true;  ///< false: that is above half a pixel, the camera moves, and `image` is of frame 0 alone
};

/// The median over frames, pixel by pixel and colour by colour, of those that no mask covers; at most 48 frames, evenly
/// chosen, which are in memory together. Where that is, background_of says. What is covered in all frames is filled
/// from what is around it.
///
/// @param size  of the result; frames are reduced to it
/// Throws DataError where every pixel is covered, and as read_frame.
Plate plate_of(const ClipVideo& video, const Camera& size);

/// Where a plate's pixels are put: on level ground at z = 0, and beyond it on an upright wall across the view.
struct PlateScene {
  double wall_distance = 10;  ///< metres from the camera, along the ground
  int spacing_px = 2;         ///< of the Gaussians in the image
  double margin = 0;          ///< by which the plate goes on with its border's colours, of its longer side
};

/// Gaussians, flat on ground and wall, that the camera sees as the plate: round in the image, and their colours are
/// such that the render is the plate (Landweber's iteration; the render is linear in them).
///
/// @param camera    in metres, z up, above the ground; of the plate's size
/// @param settings  how it will be rendered
/// Throws UserError for a camera that is not above the ground.
Gaussians scene_of_plate(const Image& plate, const Camera& camera, const PlateScene& scene,
                         const RenderSettings& settings);

}  // namespace hsi4d
