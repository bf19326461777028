// How what is seen in one picture has moved in the next.
#pragma once

#include "core/image.h"

namespace hsi4d {

/// Where each pixel of one picture is in the next, and where each of the next was: [2,H,W] pixels, right and down.
struct FlowPair {
  Image there, back;
};

/// @param from, to  [3,H,W] 0 to 1, of one size
FlowPair flow_between(const Image& from, const Image& to);

/// A place (x, y) becomes (a x + b y + u, c x + d y + v); of pixels' centres, counted from 0.
struct PlaneMotion {
  double a = 1, b = 0, c = 0, d = 1, u = 0, v = 0;
};

/// The motion that most pixels of a mask have in common: affine, fitted by weights that fall with the fourth power of
/// what a pixel is off (w = (1 + e²)⁻², Geman and McClure), from the median on. Pixels whose way there and back does
/// not end where it began do not count. Of few pixels, or where it is asked for, the median alone.
/// @param mask  [1,H,W]
PlaneMotion common_motion(const Image& mask, const FlowPair& flow, bool only_shift);

/// A picture [C,H,W] carried along by a motion; 0 where it comes from beyond the border.
Image carried(const Image& image, const PlaneMotion& motion);

/// The same of [1,H,W] by dense flow: result(x) = image(x + back(x)).
Image carried(const Image& image, const Image& back);

}  // namespace hsi4d
