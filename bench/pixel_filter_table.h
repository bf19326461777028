// `hsi4d bench pixel_filter`: what the renderer's pixel filter does to the apparent width of a figure, at several
// distances.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "bench/pixel_filter.h"

namespace hsi4d {

/// One filter, judged on one figure at one distance.
struct FilterMeasurement {
  std::string name;  ///< "pixel_filter/FIGURE/HEIGHT/TRUTH/FILTER"
  Index gaussians = 0;
  double height_px = 0;   ///< of the figure
  double distance_m = 0;  ///< from the camera
  double sigma_px = 0;    ///< mean standard deviation of a Gaussian along the surface, without blur
  double blur = 0;        ///< pixels²
  bool antialias = false;
  SilhouetteError error;
  double distance_error =
      0;  ///< relative: how much farther away the figure looks most like the truth, in least squares
};

struct PixelFilterBench {
  std::vector<std::string> figures;  ///< names; empty: all
  std::vector<double> heights_px = {32, 64, 128, 256, 512};
  int threads = 1;
};

/// Widths are to be right to this, pixels.
inline constexpr double kWidthGoalPx = 0.05;

/// Blur, pixels², that with antialias is nearly the best against the box for figures of any size.
inline constexpr double kSharpBlur = 0.02;

/// Names of the figures.
std::vector<std::string> pixel_filter_figures();

/// An avatar of `gaussians` Gaussians in its rest pose, facing +z at the origin.
PosedGaussians filter_figure(Index gaussians);

/// A camera with f = 600 px in front of it, from where it is `height_px` tall; black behind. `shift_px` moves the image
/// against the grid of pixels.
SceneView figure_view(const PosedGaussians& figure, double height_px, const Vector2<double>& shift_px);

/// Measures; `report` gets each measurement as it is made. Three truths:
///
///   box   the pixel's square alone: 8 × 8 samples a pixel, no blur
///   soft  the same seen through a lens of 0.25 px²
///   clip  what generated clips are made of: twice the size, with blur 0.3
///
/// and these filters against each of them:
///
///   none               blur 0
///   plain, antialias   blur 0.3
///   plain_box, antialias_box          blur 1/12, the variance of a square pixel
///   antialias_sharp    blur kSharpBlur
///   plain_matched, antialias_matched  the blur whose image is nearest to the truth
///
/// against the box also `antialias_within`, the widest blur whose width error is at most kWidthGoalPx, and `truth_4x`,
/// 4 × 4 samples a pixel, which bounds the error of the truth itself.
///
/// Throws UserError for a figure that is not known, or a height below 8 or above 2048 px.
void bench_pixel_filter(const PixelFilterBench& options, const std::function<void(const FilterMeasurement&)>& report);

}  // namespace hsi4d
