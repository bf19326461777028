// Images as files hold them: whole numbers or floats, the channels of a pixel side by side.
#pragma once

#include <string>

#include "core/file.h"
#include "core/image.h"

namespace hsi4d {

/// Numbers of an image as files hold them.
enum class PackedType { kUint8, kUint16, kFloat };

/// Rows of pixels, their channels side by side.
struct PackedImage {
  int width = 0, height = 0, channels = 0;
  PackedType type = PackedType::kUint8;
  Bytes values;  ///< of that type, in the machine's byte order
};

/// As [C,H,W]: v/255, v/65535, floats as they are.
Image unpacked(const PackedImage& packed);

/// Clamped to [0, 1], scaled to the largest number of the type and rounded to nearest.
/// @param type  kUint8 or kUint16
/// @param name  what error messages call the image
/// Throws DataError for NaN.
PackedImage packed(const std::string& name, const Image& image, PackedType type);

/// Throws DataError when the header's pixels are more than `file_bytes` can hold, before memory is taken for them.
void check_packed_size(const std::string& name, int64_t height, int64_t width, int64_t file_bytes);

}  // namespace hsi4d
