// `hsi4d info FILE`: what is in a file.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "splat/files/info.h"

namespace hsi4d::cli {

/// Endings of the files that `info` describes: of Gaussians, arrays, cameras, images.
std::vector<std::string> info_endings();

/// What a file holds: Gaussians by content or ending, else by ending arrays, cameras, an image. Returns what the
/// command prints.
///
/// @param json  one JSON object instead of text: file, format, rows, count, sh_degree, faults, notes, suspicious,
///              bounds, opacity and scale with their histograms. Gaussians only.
/// Throws UserError for another ending, and what the file's reader throws.
std::string info_command(const std::string& path, bool json = false);

/// What a clip would read of a video or a folder of frames: how many frames, their size and rate. Throws UserError and
/// DataError as FrameSource does, in words of the command's options.
std::string video_info(const std::string& path, std::optional<double> video_rate, std::optional<double> frame_rate);

/// Lines about Gaussians: suspicious ones, bounds, opacities, scales.
std::string statistics_text(const GaussianStatistics& statistics);

}  // namespace hsi4d::cli
