// OpenEXR files with named layers: colour, alpha, depth and masks of one view in one file.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/file.h"
#include "core/image.h"

namespace hsi4d {

/// Named planes of equal size, for example "R", "G", "B", "A", "Z", "mask.human.A".
struct Layers {
  std::vector<std::string> names;  ///< one a plane, each once
  Image planes;                    ///< [names.size(), H, W]
  std::string source;              ///< what error messages call it: the file's path

  /// The plane of that name, or -1.
  int find(std::string_view name) const;

  /// The planes of these names, in this order. Throws DataError naming the file, the first absent name and those
  /// present.
  Image select(std::span<const std::string> wanted) const;
  Image select(std::initializer_list<std::string> wanted) const;
};

/// How numbers are stored. Depth ("Z", "view.Z") is stored as float in any case: half has 11 bits.
enum class ExrPixels { float32, half };

/// Every channel of an OpenEXR file, as float.
///
/// The planes cover the display window, which is what the camera saw: pixels outside of the data window are zero, data
/// outside of the display window is left out. Tiled files give their full-size level. Deep, multi-part and subsampled
/// files are refused.
///
/// @return  names in the file's order (sorted); planes [C,H,W]; uint and half numbers converted to float
/// Throws UserError when the file cannot be read, DataError naming the path for any other kind of file, damage or size.
Layers read_layers(const std::string& path, const ImageLimits& limits = {});

/// As read_layers, of a file in memory.
Layers decode_layers(std::span<const uint8_t> file, const std::string& name, const ImageLimits& limits = {});

/// Writes every plane under its name; lossless compression (ZIP) for float32. Both windows begin at (0, 0).
///
/// Throws InternalError for names that do not fit the planes, are empty, too long or double; UserError when the path
/// cannot be written; DataError for a finite number beyond ±65504 where half was asked for.
void write_layers(const std::string& path, const Layers& layers, ExrPixels pixels = ExrPixels::float32);

/// The bytes that write_layers writes.
/// @param name  what error messages call the file
Bytes encode_layers(const std::string& name, const Layers& layers, ExrPixels pixels = ExrPixels::float32);

}  // namespace hsi4d
