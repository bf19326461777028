// A picture in memory, as a pinhole took it.
#pragma once

#include "core/camera.h"
#include "core/image.h"
#include "pipelines/photos/posed_images.h"

namespace hsi4d {

/// A picture. Planes are resampled so that what is transparent, or does not count, has no part in a mean.
struct Photo {
  Image color;   ///< [3,H,W]; where alpha is known, not multiplied by it
  Image alpha;   ///< [1,H,W] share of the pixel that shows what is wanted; empty: 1
  Image weight;  ///< [1,H,W] share of the pixel that counts: what the lens shows and no mask leaves out; empty: 1
  Image depth;   ///< [1,H,W] camera z, 0 where it is not known; empty: not known at all
  Camera camera;
};

/// What a mask says: which pixels count, or what of the picture is wanted, so that nothing is to be made behind it.
enum class MaskMeaning { kCounts, kWanted };

/// How pictures are read.
struct PhotoRules {
  int longest_side = 0;       ///< pixels, larger pictures are reduced by area; 0: as they are
  double depth_unit = 0.001;  ///< of a depth image of whole numbers; floats are in the world's units
  MaskMeaning masks = MaskMeaning::kCounts;
};

/// Depths beyond are refused.
inline constexpr float kLargestDepth = 1e9F;

/// Reads a picture: 8 or 16 bits, grey or colour, with alpha or without; of OpenEXR, whose colours are multiplied by
/// alpha, they are divided by it. Depths are grey PNG of 16 bits or OpenEXR; where a picture is straightened or reduced
/// they are those of the nearest pixel.
///
/// Throws DataError naming the file: another size than the camera's, numbers that are not finite, a mask of labels,
/// depths that are negative, beyond kLargestDepth or of another kind of file.
Photo read_photo(const PosedImage& posed, const PhotoRules& rules);

/// The camera of a picture as read_photo gives it.
Camera photo_camera(const PosedImage& posed, const PhotoRules& rules);

}  // namespace hsi4d
