// Pictures that are read as masks: what share of each pixel shows one thing. Programs write masks as grey pictures, as
// numbers of a palette, or as alpha; what is none of these is refused rather than cut to one of its channels.
#pragma once

#include <string>
#include <vector>

#include "core/image.h"

namespace hsi4d {

/// The mask [1,H,W] of an image file, 0 to 1.
///
///   a palette (PNG)        an index is a label: index 0 is background, and the one other that is used counts as 1. A
///                          palette of greys alone is a grey picture, in which the one grey beside black counts as 1.
///   transparent somewhere  the alpha, where all that is seen has one colour or is as bright as it is opaque
///   else grey              the grey
///
/// Throws as read_image. Throws DataError naming the file: more than one label; a colour mask (channels that differ by
/// more than kGreyTolerance); alpha and colours that both say something.
Image read_mask_image(const std::string& path, const ImageLimits& limits = {});

/// As read_mask_image, of an image that is decoded: grey, grey and alpha, RGB or RGBA.
/// @param name  what error messages call it
Image mask_of(const Image& image, const std::string& name);

/// 1 − mask.
Image complement(const Image& mask);

/// The greys of a mask, 1 to 255 and ascending, where they look like numbers of labels and not like shares of pixels:
/// at most eight, and a quarter of all that is not black neither nearly black nor nearly white. Else nothing.
std::vector<int> label_greys(const Image& mask);

/// How far channels of a grey picture may differ, and colours that count as one: more than JPEG and videos make of it.
inline constexpr float kGreyTolerance = 1.0F / 16;

}  // namespace hsi4d
