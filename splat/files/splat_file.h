// Files of Gaussians in any format that is known: .ply (INRIA's and compressed), .splat, .spz.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "splat/files/io_spz.h"
#include "splat/files/splat_report.h"

namespace hsi4d {

/// "F.ply, .splat or .spz" for messages and help.
inline constexpr const char* kSplatFormats = ".ply (INRIA's and compressed), .splat, .spz";

/// Whether a path ends in .ply, .splat or .spz, in any case.
bool has_splat_ending(const std::string& path);

/// Whether read_splats takes a file for one of Gaussians, by its content or its ending, or knows why it cannot be read
/// (.ksplat). A file that cannot be opened has its ending alone.
bool is_splat_file(const std::string& path);

/// Degree of the harmonics that a file of the path's ending holds, of Gaussians of degree `sh_degree`.
int written_sh_degree(const std::string& path, int sh_degree);

/// The Gaussians of a file. PLY and .spz are known by their content, .splat by the path's ending.
///
/// @param path          UTF-8
/// @param origin_world  what means become relative to, metres, in the file's digits, before they are rounded to floats
/// Throws UserError when the file cannot be read or is of no format that is known; DataError as the format's reader.
SplatFile read_splats(const std::string& path, const Vector3<double>& origin_world = Vector3<double>::Zero());

/// As read_splats; what the reader left out or put right, and its cautions, go to the log as warnings.
SplatFile read_splats_with_warnings(const std::string& path,
                                    const Vector3<double>& origin_world = Vector3<double>::Zero());

/// Warns of files whose Gaussians were trained with antialiasing (SplatReport::antialiased) and are drawn without it.
void warn_of_antialiasing(std::span<const std::string> files, bool antialias);

/// As read_splats, of a file in memory.
/// @param name  the file's name: what error messages call it, and its ending tells a .splat
SplatFile decode_splats(std::span<const std::uint8_t> file, const std::string& name,
                        const Vector3<double>& origin_world = Vector3<double>::Zero());

struct SplatWriteOptions {
  SpzOptions spz;
};

/// The bytes of a file in the format of the path's ending: .compressed.ply, .ply, .splat or .spz.
///
/// Throws UserError for another ending and for Gaussians that the format cannot hold; InternalError as check_sizes.
EncodedSplats encode_splats(const std::string& path, const Gaussians& gaussians, const SplatWriteOptions& options = {});

/// Writes Gaussians in the format of the path's ending, in one step (see AtomicFile). Returns what the format could not
/// hold beyond rounding: reasons and numbers.
///
/// Throws as encode_splats, and UserError when the path cannot be written.
Counts write_splats(const std::string& path, const Gaussians& gaussians, const SplatWriteOptions& options = {});

}  // namespace hsi4d
