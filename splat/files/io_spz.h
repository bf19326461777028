// Gaussians in .spz files of versions 1 to 4: about 20 bytes each before packing, harmonics in a byte each.
//
// Versions 1 to 3 are a gzip stream (read also without it) of a 16-byte header and the attributes, one after the other:
//
//   "NGSP"   uint32 version   uint32 count   byte degree   byte fractional bits   byte flags   byte 0
//
// Version 4 is a 32-byte header, records of extensions, a table of lengths and a Zstandard frame for each attribute:
//
//   "NGSP"   uint32 4   uint32 count   byte degree, fractional bits, flags, number of frames   uint32 place of the
//   table 12 bytes 0;   the table: for each frame uint64 packed bytes, uint64 unpacked bytes
//
// Attributes, in this order, each for all Gaussians:
//
//   positions    3 × 24-bit signed integers, in 2^−(fractional bits) metres (version 1: 3 × half floats)
//   opacities    1 byte, 255 times the opacity
//   colours      3 × 1 byte, 255 (0.15 f_dc + ½)
//   log-scales   3 × 1 byte, 16 (log-scale + 10)
//   rotations    to version 2: 3 × 1 byte, 127.5 (1 + x, y, z) of the unit quaternion with w ≥ 0.
//                From version 3: 32 bits; the 2 highest say which of x, y, z, w is the largest, 0 to 3; the others in
//                this order, 10 bits each: sign, then 9 bits for 511 √2 times the magnitude
//   harmonics    3 (K − 1) × 1 byte, 128 (f + 1), coefficient by coefficient, red, green and blue of each
//
// The file's axes are x right, y up, z back, against y down, z forward here: y and z change sign, and so do some
// harmonics. Flags: 1, trained with antialiasing; 2, there are records of extensions (uint32 type, uint32 length,
// content): in version 4 before the table, else at the end. The one that names other axes is heeded.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "splat/files/quantised.h"
#include "splat/files/splat_report.h"

namespace hsi4d {

struct SpzOptions {
  int version = 3;           ///< 2, 3 or 4
  int sh1_bits = 8;          ///< of harmonics of degree 1, 1 to 8: fewer pack smaller
  int sh_rest_bits = 8;      ///< of those above
  bool antialiased = false;  ///< the flag that the Gaussians were trained with antialiasing
  int fractional_bits = -1;  ///< of positions, 0 to 23; −1: as many as the farthest one leaves, at most 20
};

/// The Gaussians of a .spz file. Harmonics of degree 4 are left out and counted.
///
/// @param origin_world  what means become relative to before they are rounded
/// Throws DataError naming the file: no .spz file, a version, degree or axes that are not read, sizes that contradict
/// each other, damage. No more memory is taken than the file's size makes credible.
SplatFile decode_spz(std::span<const std::uint8_t> file, const std::string& name,
                     const Vector3<double>& origin_world = Vector3<double>::Zero());

/// The bytes of a .spz file, the origin added to the means, rows in order.
///
/// Errors of what is read back: positions half of 2^−(fractional bits) metres, opacities 1/510, colours f_dc 1/76.5
/// within ±3.33, log-scales 1/32 from −10 to 5.94, quaternion components 1/255 (version 2; w follows from them) or
/// 0.0007 (3 and 4), harmonics 1/256 from −1 to 0.992, with fewer bits 2^−bits.
/// Throws UserError for numbers that are not finite, positions too far out for the bits, or options out of range;
/// InternalError as check_sizes.
EncodedSplats encode_spz(const Gaussians& gaussians, const SpzOptions& options = {});

}  // namespace hsi4d
