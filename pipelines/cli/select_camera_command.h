// `hsi4d select-camera`.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "optim/loss_description.h"

namespace hsi4d::cli {

/// Arguments of the command.
struct SelectCameraOptions {
  std::filesystem::path config;
  std::vector<std::string> overrides;
  std::string out;    ///< camera.json; empty: not written
  std::string image;  ///< what the camera sees, .png, .jpg or .exr; empty: not written
  bool quiet = false;
};

/// Chooses the camera of frame 0 (pipelines/draw/camera_selection.h), and returns the best candidates as a table. The
/// config needs data.scene, avatar, initial and the objects; of data.camera, where it is given, size and focal lengths
/// are taken. Throws UserError and DataError for its inputs, Interrupted.
std::string select_camera_command(const SelectCameraOptions& options, const std::vector<LossDescription>& losses);

}  // namespace hsi4d::cli
