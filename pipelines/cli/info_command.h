// `hsi4d info FILE`: what is in a file.
#pragma once

#include <string>

namespace hsi4d::cli {

/// What a file holds, by its ending: Gaussians (.ply), arrays (.npz, .npy), cameras (.json), images (.png, .jpg, .jpeg,
/// .exr). Returns what the command prints.
///
/// Throws UserError for another ending, and what the file's reader throws.
std::string info_command(const std::string& path);

}  // namespace hsi4d::cli
