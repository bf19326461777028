// Scenes that are a picture: the background of a video, put on a ground and a wall. Their files say so.
#pragma once

#include <filesystem>
#include <string>

#include "splat/gaussians.h"

namespace hsi4d {

/// What is told of a run in such a scene.
inline constexpr const char* kPlateText =
    "a plate: the background of the video on a level ground and an upright wall, whose depths are a guess";

/// Writes Gaussians as a .ply that says by a comment that they are a plate. Throws as write_ply.
void write_plate_splats(const std::string& path, const Gaussians& gaussians);

/// Whether a file is such a .ply; not of one that cannot be read.
bool is_plate_file(const std::filesystem::path& path);

}  // namespace hsi4d
