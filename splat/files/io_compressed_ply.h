// Compressed PLY files, as PlayCanvas's tools write them: 16 bytes a Gaussian, harmonics in a byte each.
//
// A chunk is 256 Gaussians in a row of the file, the last one fewer. The elements are
//
//   chunk   float min_x min_y min_z max_x max_y max_z, min_scale_x ... max_scale_z, min_r min_g min_b max_r max_g max_b
//   vertex  uint packed_position packed_rotation packed_scale packed_color
//   sh      uchar f_rest_0..3(K-1)-1, only with harmonics of degree 1 or more
//
// A packed number holds fields of the given widths, highest bits first; a field of b bits with level u stands for
// u/(2ᵇ − 1) of the way from the chunk's least to its greatest value:
//
//   packed_position   x 11, y 10, z 11          packed_scale      log-scales x 11, y 10, z 11
//   packed_color      r 8, g 8, b 8 of ½ + Y₀ f_dc (from 0 to 1 where the chunk has no bounds of colours), opacity 8
//   packed_rotation   2 bits: which of w, x, y, z is the largest, 0 to 3; the three others in this order, 10 bits each,
//                     for √2 (u/1023 − ½); the largest makes the length 1 and is positive
//   f_rest_           level u stands for 8 ((u + ½)/256 − ½); 0 and 255 for −4 and 4
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "splat/files/ply_table.h"
#include "splat/files/quantised.h"
#include "splat/files/splat_report.h"

namespace hsi4d {

/// Whether the header has a `vertex` element with packed properties.
bool is_compressed_ply(const PlyHeader& header);

/// The Gaussians of a compressed PLY file. Rows with numbers that are not finite are left out and counted, as in
/// splat/files/splat_rows.h.
///
/// @param origin_world  what means become relative to before they are rounded
/// Throws DataError naming the file: an element or property missing or of another type, numbers of chunks or harmonics
/// that do not fit the number of Gaussians, fewer or more bytes than the header's counts need.
SplatFile decode_compressed_ply(std::span<const std::uint8_t> file, const PlyHeader& header, const std::string& name,
                                const Vector3<double>& origin_world = Vector3<double>::Zero());

/// Gaussians in the order in which encode_compressed_ply writes them, so that chunks are small boxes: along a Z-order
/// curve through the means' bounds, equal places by index.
std::vector<Index> compressed_ply_order(const Gaussians& gaussians);

/// The bytes of a compressed PLY file, the origin added to the means, rows in compressed_ply_order.
///
/// Errors of what is read back: positions and log-scales half a level of their chunk's extent, colours likewise,
/// opacities 1/510, harmonics 1/64 (1/32 beyond ±3.97), quaternions 0.0007 in each of the three components.
/// Throws UserError for numbers that are not finite; InternalError as check_sizes.
EncodedSplats encode_compressed_ply(const Gaussians& gaussians);

}  // namespace hsi4d
