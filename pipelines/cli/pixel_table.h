// `hsi4d render --debug-pixel X,Y`: which Gaussians made a pixel, as text.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "pipelines/draw/image_of_scene.h"

namespace hsi4d::cli {

/// Rows of a render that come from one file.
struct FileRows {
  std::string file;
  Index begin = 0, end = 0;   ///< rows of the render
  std::vector<Index> row_of;  ///< the file's row of each; empty: they are the file's rows
};

/// "X,Y", column and row. Throws UserError unless it is a pixel of the image.
PixelPlace parse_pixel(const std::string& text, const Camera& camera, const std::string& where);

/// A table of what was composited, front to back, and lines of what was not, of where it stopped, and of the sums.
///
/// @param files  where the rows come from, in their order
std::string pixel_table(const PixelTrace& trace, const SceneImage& rendered, const SceneView& view,
                        std::span<const FileRows> files);

}  // namespace hsi4d::cli
