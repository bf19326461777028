// What this project takes from OpenImageIO, as a library of its own that is loaded when the first image is read that is
// no PNG, JPEG or OpenEXR: OpenImageIO brings 250 shared libraries, which take half a second to load.
#pragma once

#include <functional>
#include <string>

#include "core/packed_image.h"

namespace hsi4d {

/// What a file says of its image before it is decoded.
struct ImageFacts {
  int width = 0, height = 0, channels = 0;
  bool is_volume = false;  ///< deep, or of several slices
};

/// Looks at it, and throws where the image is not to be decoded.
using FactsCheck = std::function<void(const ImageFacts&)>;

/// Decodes a file of any kind, its alpha not multiplied into its colours. Returns what was wrong, or "".
using ReadByCodec = std::string (*)(const std::string& path, const FactsCheck& check, PackedImage& image);

/// The library's function; the first call loads it. For several threads at once. Throws InternalError telling where it
/// was sought.
ReadByCodec image_codec();

}  // namespace hsi4d
