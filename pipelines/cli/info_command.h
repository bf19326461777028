// `hsi4d info FILE`: what is in a file.
#pragma once

#include <string>

#include "splat/files/info.h"

namespace hsi4d::cli {

/// What a file holds, by its ending: Gaussians (.ply, .splat, .spz), arrays (.npz, .npy, .safetensors), cameras
/// (.json), images
/// (.png, .jpg, .jpeg, .exr). Returns what the command prints.
///
/// @param json  one JSON object instead of text: file, format, rows, count, sh_degree, faults, notes, suspicious,
/// bounds,
///              opacity and scale with their histograms. Gaussians only.
/// Throws UserError for another ending, and what the file's reader throws.
std::string info_command(const std::string& path, bool json = false);

/// Lines about Gaussians: suspicious ones, bounds, opacities, scales.
std::string statistics_text(const GaussianStatistics& statistics);

}  // namespace hsi4d::cli
