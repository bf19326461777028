// The pixel filter of a video, as its frame 0 tells it.
#pragma once

#include "pipelines/config/run_config.h"
#include "pipelines/input/clip.h"

namespace hsi4d {

/// What `render.blur` "estimate" comes to.
struct PixelFilter {
  double blur = 0;         ///< variance, pixels²
  double psnr_db = 0;      ///< of the foreground of frame 0 with it
  bool is_widest = false;  ///< a wider one may be nearer
};

/// The widest that is looked for, standard deviation, pixels.
inline constexpr double kWidestFilter = 1.2;

/// The blur with which frame 0, drawn in the state that is given, is nearest to the video's: least squared difference
/// where the masks show the human or an object, or two pixels around, for silhouettes say how far a filter spreads
/// them; of the whole image where the masks show nothing. To a thousandth of a squared pixel, whatever the threads.
///
/// A filter that is too wide fattens what is drawn, which then seems to be further away (docs/numerics/renderer.md).
PixelFilter estimated_pixel_filter(const RunConfig& config, const Clip& clip);

}  // namespace hsi4d
