// JPEG files by libjpeg-turbo.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "core/packed_image.h"

namespace hsi4d {

/// The JPEG in `file` as [1,H,W] or [3,H,W], v/255. Inks (CMYK) become RGB without a colour profile.
///
/// @param name  what error messages call the file
/// Throws DataError for a damaged, truncated or oversized image.
Image decode_jpeg(std::span<const uint8_t> file, const std::string& name, const ImageLimits& limits);

/// What libjpeg takes, pixels.
inline constexpr int kLargestJpegSide = 65500;

/// The JPEG file of an 8-bit image of one or three channels, of at most kLargestJpegSide.
/// @param quality     1 to 100
/// @param half_color  colour in half the resolution (4:2:0)
Bytes encode_jpeg(const PackedImage& image, int quality, bool half_color);

}  // namespace hsi4d
