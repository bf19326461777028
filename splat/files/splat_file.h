// Files of Gaussians in any format of splat/files/list.h.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "splat/files/list.h"

namespace hsi4d {

/// Endings of files that are read: ".ply", ".splat", …
std::vector<std::string> splat_endings();

/// Endings of files that are written: ".ply", ".compressed.ply", …
std::vector<std::string> written_splat_endings();

/// ".ply (INRIA's and compressed), …, .spz" for messages; with " or " for both ".ply (INRIA's or compressed), … or
/// .spz".
/// @param between  the kinds of an ending
/// @param last     before the last ending
std::string splat_formats_text(const std::string& between = " and ", const std::string& last = ", ");

/// "F.{ply,splat,…}" for options.
std::string splat_type_name();

/// Whether a path ends as a file of Gaussians does, in any case.
bool has_splat_ending(const std::string& path);

/// Whether read_splats takes a file for one of Gaussians, by its content or its ending, or knows why it cannot be read
/// (.ksplat). A file that cannot be opened has its ending alone.
bool is_splat_file(const std::string& path);

/// Degree of the harmonics that a file of the path's ending holds, of Gaussians of degree `sh_degree`.
int written_sh_degree(const std::string& path, int sh_degree);

/// The Gaussians of a file. Its format is known by its first bytes, else by the path's ending.
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
/// @param name  the file's name: what error messages call it, and its ending says what the first bytes do not
SplatFile decode_splats(std::span<const std::uint8_t> file, const std::string& name,
                        const Vector3<double>& origin_world = Vector3<double>::Zero());

/// The bytes of a file in the format of the path's ending.
///
/// Throws UserError for another ending and for Gaussians that the format cannot hold; InternalError as check_sizes.
EncodedSplats encode_splats(const std::string& path, const Gaussians& gaussians, const SplatWriteOptions& options = {});

/// Writes Gaussians in the format of the path's ending, in one step (see AtomicFile). Returns what the format could not
/// hold beyond rounding: reasons and numbers.
///
/// Throws as encode_splats, and UserError when the path cannot be written.
Counts write_splats(const std::string& path, const Gaussians& gaussians, const SplatWriteOptions& options = {});

}  // namespace hsi4d
