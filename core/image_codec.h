// What this project takes from OpenImageIO, as a library of its own that is loaded when the first image is read or
// written: OpenImageIO brings 250 shared libraries, which take half a second to load.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/file.h"

namespace hsi4d {

/// Numbers of an image as files hold them.
enum class PackedType { kUint8, kUint16, kFloat };

/// An image as files hold it: rows of pixels, their channels side by side.
struct PackedImage {
  int width = 0, height = 0, channels = 0;
  PackedType type = PackedType::kUint8;
  Bytes values;  ///< of that type, in the machine's byte order
};

/// What a file says of its image before it is decoded.
struct ImageFacts {
  int width = 0, height = 0, channels = 0;
  bool is_volume = false;  ///< deep, or of several slices
};

/// Looks at it, and throws where the image is not to be decoded.
using FactsCheck = std::function<void(const ImageFacts&)>;

/// Options of a writer by name: text, or a whole number.
struct CodecOptions {
  std::vector<std::pair<std::string, std::string>> texts;
  std::vector<std::pair<std::string, int>> numbers;
};

/// The functions of the library. Each returns what was wrong, or "".
struct ImageCodec {
  /// Decodes a file of any kind, its alpha not multiplied into its colours.
  std::string (*read_file)(const std::string& path, const FactsCheck& check, PackedImage& image);
  /// Decodes a JPEG in memory.
  /// @param name  what messages call it
  std::string (*read_jpeg)(std::span<const uint8_t> file, const std::string& name, const FactsCheck& check,
                           PackedImage& image);
  /// Encodes into `file`. @param format  "png" or "jpeg"
  std::string (*write)(const std::string& format, const PackedImage& image, const CodecOptions& options, Bytes& file);
};

/// The library, loaded by the first call: by several threads at once. Throws InternalError telling where it was sought.
const ImageCodec& image_codec();

}  // namespace hsi4d
