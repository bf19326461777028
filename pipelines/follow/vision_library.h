// What this project takes from OpenCV, as a library of its own that is loaded when it is first needed
// (core/loaded_library.h). All of it runs on one thread: OpenCV's optical flow depends on their number.
#pragma once

#include <string>

#include "core/image.h"

namespace hsi4d {

/// Planes of numbers in which each pixel is compared with four of its neighbours: right, below, below right, below
/// left.
inline constexpr int kCutLinks = 4;

/// The library's functions. Each returns what was wrong, or "".
struct VisionLibrary {
  /// Where each pixel of `from` is in `to`: from(x) ≈ to(x + flow(x)).  [Kroeger et al. 2016, DIS; preset "medium"]
  /// @param from, to  [1,H,W] brightness, 0 to 1; at least 16 pixels high and wide
  /// @param flow      [2,H,W] pixels, right and down
  std::string (*find_flow)(const Image& from, const Image& to, Image& flow);
  /// The labels of the least sum of −odds(x) over pixels with label 1 and of links between neighbours that differ.
  /// [Boykov and Kolmogorov 2004]
  /// @param odds    [1,H,W]
  /// @param links   [kCutLinks,H,W] ≥ 0; those across the border are of no meaning
  /// @param labels  [1,H,W] 0 or 1
  std::string (*cut)(const Image& odds, const Image& links, Image& labels);
  /// Distance of each pixel's centre from the nearest one of a mask above ½; 0 there.  [Felzenszwalb 2004]
  /// @param mask  [1,H,W], with such a pixel
  std::string (*find_distances)(const Image& mask, Image& distances);
  /// What is an object in a rectangle around it.  [Rother et al. 2004, GrabCut; eight rounds]
  /// @param image   [3,H,W] 0 to 1
  /// @param labels  [1,H,W] 0 not, ¼ probably not, ¾ probably, 1 the object; the result is 0 or 1
  std::string (*grab)(const Image& image, Image& labels);
};

/// Loads it at the first call. For several threads at once. Throws InternalError as function_of_library.
const VisionLibrary& vision_library();

}  // namespace hsi4d
