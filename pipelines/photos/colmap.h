// COLMAP's sparse models, text and binary [COLMAP documentation, "Output Format"].
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "pipelines/photos/posed_images.h"

namespace hsi4d {

/// A file in memory.
struct NamedBytes {
  std::string name;  ///< what messages call it; ends in .bin or .txt, which says how it is read
  std::span<const std::uint8_t> bytes;
};

/// A model: pictures by their names alone, and points.
struct ColmapModel {
  std::vector<PosedImage> images;
  std::vector<ColoredPoint> points;
};

/// The folder of the model in `folder`: itself, sparse/0 or sparse. Empty: there is none.
std::filesystem::path colmap_folder(const std::filesystem::path& folder);

/// Reads the three files of a folder; points3D may be missing. Throws UserError for files that cannot be read, and as
/// decode_colmap.
ColmapModel read_colmap(const std::filesystem::path& folder);

/// Decodes a model. Cameras: SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV; others are refused by name.
///
/// @param points  without a name: none
/// Throws DataError naming the file and the byte or line: it ends too early, has more, a camera is named that is not
/// there, a number is not finite or out of its range; UserError for a camera model that is not read.
ColmapModel decode_colmap(const NamedBytes& cameras, const NamedBytes& images, const NamedBytes& points);

}  // namespace hsi4d
