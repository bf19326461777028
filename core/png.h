// PNG decoding through libpng itself: OpenImageIO's reader lets libpng print its complaints.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "core/image.h"

namespace hsi4d {

/// The PNG in `file` as [C,H,W]: v/255, or v/65535 where it has 16 bits. Palettes and fewer bits are expanded, a
/// transparent colour becomes alpha; gamma and profiles are ignored.
///
/// @param name  what error messages call the file
/// Throws DataError for a damaged, truncated or oversized image.
Image decode_png(std::span<const uint8_t> file, const std::string& name, const ImageLimits& limits);

/// Throws DataError when the header's pixels are more than `file_bytes` can hold, before memory is taken for them.
void check_packed_size(const std::string& name, int64_t height, int64_t width, int64_t file_bytes);

}  // namespace hsi4d
