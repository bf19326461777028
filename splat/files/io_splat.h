// Gaussians in .splat files: 32 bytes each, without a header, colours the same from everywhere.
//
//   float x y z   float scale_x scale_y scale_z (metres)   byte r g b a   byte w x y z
//
// r, g, b stand for (½ + Y₀ f_dc) 255, a for the opacity times 255, the quaternion's bytes for (b − 128)/128.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "splat/files/quantised.h"
#include "splat/files/splat_report.h"

namespace hsi4d {

/// The Gaussians of a .splat file, degree 0. Rows with numbers that are not finite, scales below 0 or a quaternion that
/// is zero are left out and counted; a scale of 0 is held at the smallest that is read, as in splat/files/splat_rows.h.
///
/// @param origin_world  what means become relative to before they are rounded
/// Throws DataError naming the file when its size is not a multiple of 32 bytes.
SplatFile decode_splat(std::span<const std::uint8_t> file, const std::string& name,
                       const Vector3<double>& origin_world = Vector3<double>::Zero());

/// The bytes of a .splat file, the origin added to the means, rows in order. Harmonics of degree 1 and more are lost.
///
/// Errors of what is read back: means and scales those of a float, opacities 1/510, colours ½ + Y₀ f_dc 1/510 between 0
/// and 1, quaternions 1/256 in each component (1/128 of one near 1) before they are normalised.
/// Throws UserError for numbers that are not finite; InternalError as check_sizes.
EncodedSplats encode_splat(const Gaussians& gaussians);

}  // namespace hsi4d
