// Which depths of a picture a fit may trust: those of whole pixels inside of surfaces.
#pragma once

#include "autodiff/array.h"
#include "pipelines/photos/photo.h"

namespace hsi4d {

/// By how much 1/z may bend from pixel to pixel, of 1/z. It does not on a plane.
inline constexpr float kMostBend = 0.01F;

/// Writes a picture's depths, camera z, and 0 where they are not known, where not all of the pixel counts or shows what
/// is wanted, and beside edges: where 1/z bends across the pixel by more than kMostBend, or a neighbour is not known.
///
/// @param target  [1,H,W]
/// Throws InternalError: another size than the picture's, no depths.
void write_depth_target(const Photo& photo, const Array<float>& target);

}  // namespace hsi4d
