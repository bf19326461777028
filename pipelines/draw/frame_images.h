// Images of a frame: what masks cover, what is shown of the result.
#pragma once

#include "autodiff/tape.h"
#include "core/image.h"
#include "pipelines/config/data_settings.h"
#include "pipelines/input/clip.h"

namespace hsi4d {

/// Pixels that a mask of the frame covers, at or above data.mask_threshold and grown by data.mask_margin_px to all
/// sides, are set in `covered` [1,H,W].
void add_covered(const ClipFrame& frame, const DataSettings& data, Image& covered);

/// 1 where the frame shows the background, else 0, as it does beyond a lens: away from all masks, which count from 0.1
/// on and are grown by 1/64 of the longer side, as mattes end before shadows and hair do.
Image background_of(const ClipFrame& frame);

/// The larger of all masks of the frame, pixel by pixel.
Image foreground_of(const ClipFrame& frame);

/// Sets to 0 what the frame does not see, as its lens bends.
void hide_unseen(const ClipFrame& frame, Image& image);

/// kDifferenceGain |a − b|.
Image difference_image(const Image& a, const Image& b);

/// An array of planes as an image.
template <class S>
Image to_image(const ConstArray<S>& array);

}  // namespace hsi4d
