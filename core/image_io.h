// Image files. Values are never colour-converted, in either direction.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "core/file.h"
#include "core/image.h"

namespace hsi4d {

/// How write_image stores numbers; each field matters to one format.
struct ImageFormat {
  int png_bits = 8;              ///< 8 or 16
  int jpeg_quality = 95;         ///< 1 to 100
  bool jpeg_half_color = false;  ///< colour in half the resolution (4:2:0): a quarter smaller, seen at sharp edges
  bool exr_half = false;         ///< 16-bit instead of 32-bit floats
};

/// An image file: PNG, JPEG, OpenEXR, or whatever else OpenImageIO reads.
///
/// 8-bit numbers are v/255, 16-bit ones v/65535, floats as they are. Channels are as in the file: 1 grey, 2 grey and
/// alpha, 3 RGB, 4 RGBA; alpha is neither multiplied in nor divided out. OpenEXR gives R,G,B[,A] or Y[,A], which must
/// be there (see exr.h for other layers and for data windows). The orientation that a camera noted in a JPEG is not
/// applied.
///
/// @param path  UTF-8
/// @return      [C,H,W]
/// Throws UserError when the file cannot be read, DataError naming the path for a damaged, truncated or oversized
/// image.
Image read_image(const std::string& path, const ImageLimits& limits = {});

/// As read_image, of a PNG, JPEG or OpenEXR file in memory.
/// @param name  what error messages call it
Image decode_image(std::span<const uint8_t> file, const std::string& name, const ImageLimits& limits = {});

/// Throws DataError naming the first pixel of an image that is transparent somewhere: what is behind it is not known.
/// @param name  what error messages call it
/// @param what  what it is read as: "a frame"
void check_opaque(const Image& image, const std::string& name, const char* what);

/// Writes an image; the path's ending says how: .png (1 to 4 channels), .jpg or .jpeg (1 or 3), .exr (1 to 4).
///
/// PNG and JPEG: clamped to [0, 1], times the largest integer, rounded to nearest. OpenEXR: float as it is, half
/// rounded.
///
/// Throws UserError for another ending, number of channels or setting, an empty image, or a path that cannot be
/// written; DataError for NaN in PNG or JPEG, or a number beyond the range of half.
void write_image(const std::string& path, const Image& image, const ImageFormat& format = {});

/// The bytes that write_image writes.
Bytes encode_image(const std::string& path, const Image& image, const ImageFormat& format = {});

}  // namespace hsi4d
