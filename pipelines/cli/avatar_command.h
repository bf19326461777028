// `hsi4d avatar`: files of avatars made, imported and described.
#pragma once

#include <string>

#include "body/avatar.h"

namespace hsi4d::cli {

/// `hsi4d avatar make` and `import`.
struct AvatarOptions {
  std::string in;                  ///< of import: the Gaussians
  std::string body_model;          ///< SMPL-X file; empty (of make): the body that comes with the program
  std::string betas;               ///< its shape: numbers apart by commas; empty: the mean shape
  std::string gender = "neutral";  ///< of the body model
  AvatarSettings settings = {.gaussians = 50000};  ///< of make
  std::string out;
};

/// Dresses a body in Gaussians and writes the avatar. Returns a line about it.
/// Throws UserError naming the option, or what read_smplx throws.
std::string avatar_make_command(const AvatarOptions& options);

/// Binds the Gaussians of a file to a body model and writes the avatar. Returns lines about it.
/// Throws UserError naming the option, and as read_scene, read_smplx and import_avatar.
std::string avatar_import_command(const AvatarOptions& options);

/// What an avatar's file holds: Gaussians, skeleton, weights, color net, suspicious things.
/// Throws as read_avatar.
std::string avatar_info_command(const std::string& path);

}  // namespace hsi4d::cli
