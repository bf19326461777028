// PNG files by libpng.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/packed_image.h"

namespace hsi4d {

/// The PNG in `file` as [C,H,W]: v/255, or v/65535 where it has 16 bits. Palettes and fewer bits are expanded, a
/// transparent colour becomes alpha; gamma and profiles are ignored.
///
/// @param name  what error messages call the file
/// Throws DataError for a damaged, truncated or oversized image, and for colours that are not those of a usual screen
/// by the chunk cICP: PQ, HLG, BT.2020, Display P3.
Image decode_png(std::span<const uint8_t> file, const std::string& name, const ImageLimits& limits);

/// The name of the colour profile in a PNG (chunk iCCP), where it is that of a wider gamut than sRGB's; else empty.
/// @param start  of the file; the profile is before the pixels
std::string wide_profile(std::span<const uint8_t> start);

/// Whether a file begins as a PNG does.
/// @param start  its first eight bytes
bool is_png(std::span<const uint8_t> start);

/// Red, green, blue, alpha.
using PaletteColor = std::array<uint8_t, 4>;

/// A PNG with a palette as its file has it.
struct PaletteImage {
  int width = 0, height = 0;
  Bytes indices;                     ///< row by row
  std::vector<PaletteColor> colors;  ///< by index; empty: the PNG has no palette
};

/// The indices and the palette of a PNG; nothing of one without a palette. Errors as decode_png.
PaletteImage decode_palette(std::span<const uint8_t> file, const std::string& name, const ImageLimits& limits);

/// The PNG file of an 8-bit or 16-bit image of one to four channels: grey, grey and alpha, RGB, RGBA.
Bytes encode_png(PackedImage image);

}  // namespace hsi4d
