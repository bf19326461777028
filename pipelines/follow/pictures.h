// Small operations on the pictures that are looked at.
#pragma once

#include <string>

#include "core/image.h"

namespace hsi4d {

/// Throws InternalError where the library says what was wrong.
void must_work(const std::string& error, const char* what);

/// The picture with a longer side of at most that many pixels.
Image reduced_to(const Image& image, int longest_side_px);

/// A mask at a larger size, bilinear; itself at its own.
Image enlarged_mask(const Image& mask, int height, int width);

/// Whether some pixel is above ½.
bool shows_something(const Image& mask);

/// Channel c at column x, row y (of pixels' centres, counted from 0), bilinear; 0 beyond the border.
float sample(const Image& image, int c, double y, double x);

}  // namespace hsi4d
