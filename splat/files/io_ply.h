// Gaussians in PLY files, in the layout of the INRIA reference implementation.
//
// The element `vertex` has a row per Gaussian and the scalar properties
//
//   x y z   f_dc_0..2   f_rest_0..3(K-1)-1   opacity   scale_0..2   rot_0..3
//
// in any order and of any number type: the mean in metres, the spherical harmonics (sh[n,0,c] = f_dc_c,
// sh[n,k,c] = f_rest_{c(K-1)+k-1}), the opacity's logit, the logs of the scales, the quaternion wxyz.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "splat/files/splat_report.h"

namespace hsi4d {

/// The Gaussians of a PLY file.
///
/// Binary of both byte orders, and ascii. Other elements and properties are passed over, with a caution but for
/// normals; `filter_3D` of Mip-Splatting is fused into scales and opacities. A row is left out, and counted, when a
/// number of it is not finite (an opacity of ±inf is) or its quaternion is zero; opacity logits and log-scales beyond
/// ±kOpacityLogitLimit and ±kLogScaleLimit are held there, and counted. A compressed PLY
/// (splat/files/io_compressed_ply.h) is known by its properties and read too.
///
/// @param path  UTF-8
/// Throws UserError when the file cannot be read; DataError naming the path, and the header's line or the sizes: no PLY
/// file, a header that is not PLY's, a property missing, twice or a list, f_rest_ properties that are not 0, 9, 24 or
/// 45 in number, fewer or more bytes than the header's counts need.
SplatFile read_ply(const std::string& path);

/// As read_ply, of a file in memory.
/// @param name  what error messages call it
/// @param origin_world  what means become relative to before they are rounded
SplatFile decode_ply(std::span<const std::uint8_t> file, const std::string& name,
                     const Vector3<double>& origin_world = Vector3<double>::Zero());

/// Writes Gaussians as binary little-endian floats, INRIA's properties in INRIA's order, normals zero; in one step (see
/// AtomicFile). An origin is added to the means.
///
/// Throws InternalError as check_sizes, UserError when the path cannot be written.
void write_ply(const std::string& path, const Gaussians& gaussians);

/// The bytes that write_ply writes.
std::vector<std::uint8_t> encode_ply(const Gaussians& gaussians);

}  // namespace hsi4d
