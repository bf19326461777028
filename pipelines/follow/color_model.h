// How often colours are in a part of a picture.
#pragma once

#include <vector>

#include "core/image.h"

namespace hsi4d {

/// A smoothed histogram over brightness and two differences of colours; its densities are relative to a picture in
/// which all colours are alike.
struct ColorModel {
  std::vector<float> densities;  ///< of cells; empty: nothing is known

  bool empty() const { return densities.empty(); }
};

/// The colours of pixels.
/// @param image    [3,H,W] 0 to 1
/// @param weights  [1,H,W] ≥ 0, how much a pixel counts; all 0: an empty model
ColorModel colors_of(const Image& image, const Image& weights);

/// (1 − share) a + share b; the other one where one is empty.
ColorModel mixed(const ColorModel& a, const ColorModel& b, double share);

/// log(a / b) of each pixel's colour, held within ±kMostColorOdds; 0 where a model is empty.
/// @param image  [3,H,W] 0 to 1
/// @return       [1,H,W]
Image color_odds(const Image& image, const ColorModel& a, const ColorModel& b);

inline constexpr float kMostColorOdds = 4;

}  // namespace hsi4d
