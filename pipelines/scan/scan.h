// A reconstruction from its config to its folder.
//
//   config.json          every setting
//   pictures/            of a mesh, with their cameras (pipelines/rig/mesh_photos.h)
//   checkpoint.npz       where it goes on (`--resume`); not there any more when it is done
//   scene.ply            or object.ply: the Gaussians
//   cameras.json         of the pictures, straightened and reduced as they were seen, in the order of names
//   views/NNNN_NAME.png  how the result shows the pictures that were held back, beside NNNN_NAME_photo.png
//   summary.json         sizes, times, PSNR and SSIM
//   report.html          the same for people
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "pipelines/scan/fit.h"

namespace hsi4d {

/// What a reconstruction came to.
struct ScanSummary {
  std::string name;  ///< of its folder
  Index gaussians = 0, iterations = 0;
  int width = 0, height = 0;  ///< of the pictures as they were seen
  double seconds = 0;         ///< of the fit; what was resumed counts from there
  ScanScore learnt, held;
  std::vector<double> curve;  ///< as ScanState
  std::vector<ScanPicture> pictures;
  std::vector<std::string> names;  ///< of the pictures
};

/// Makes the Gaussians. Returns what it came to.
///
/// @param folder  new or empty; with `resume` one that was begun by the same config
/// Throws UserError for folders that are not so, and as read_posed_images, prepare_mesh_photos, read_photo,
/// first_gaussians, fit_scan; Interrupted, when what was done so far can be resumed.
ScanSummary run_scan(const ScanSettings& settings, const std::filesystem::path& folder, bool resume,
                     std::span<const LossTerm> terms, const Observer& observer = {});

/// Whether a folder is of a reconstruction, by its config. Throws as read_text_file.
bool is_scan_folder(const std::filesystem::path& folder);

/// Where the Gaussians are.
std::filesystem::path scan_result(const ScanSettings& settings, const std::filesystem::path& folder);

}  // namespace hsi4d
