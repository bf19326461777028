// `hsi4d bench pixel_filter`: what the renderer's pixel filter does to the apparent width of a figure, at several
// distances.
#pragma once

#include <string>
#include <vector>

#include "bench/pixel_filter.h"

namespace hsi4d {

struct PixelFilterBench {
  std::vector<std::string> figures;  ///< names; empty: all
  std::vector<double> heights_px = {32, 64, 128, 256, 512};
  int threads = 1;
  std::string json;  ///< path to write one JSON object a measurement to; empty: none
};

/// Widths are to be right to this, pixels.
inline constexpr double kWidthGoalPx = 0.05;

/// Blur, pixels², that with antialias is nearly the best against the box for figures of any size.
inline constexpr double kSharpBlur = 0.02;

/// An avatar of `gaussians` Gaussians in its rest pose, facing +z at the origin.
PosedGaussians filter_figure(Index gaussians);

/// A camera with f = 600 px in front of it, from where it is `height_px` tall; black behind. `shift_px` moves the image
/// against the grid of pixels.
SceneView figure_view(const PosedGaussians& figure, double height_px, const Vector2<double>& shift_px);

/// Measures, and returns a table. Three truths:
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
std::string bench_pixel_filter(const PixelFilterBench& options);

}  // namespace hsi4d
