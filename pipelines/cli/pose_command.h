// `hsi4d pose`: vertices and joints of an SMPL-X body.
#pragma once

#include <string>

namespace hsi4d::cli {

struct PoseOptions {
  std::string body_model;           ///< --body-model M.npz
  std::string params;               ///< --params P.npz
  std::string out;                  ///< --out F.npz
  std::string precision = "float";  ///< --precision float|double
  std::string hands = "auto";       ///< --hands auto|full|pca
  bool flat_hand_mean = false;      ///< --flat-hand-mean
};

/// Poses the body in every frame of the parameters (see read_smplx_sequence) and writes `vertices` [T,V,3] and
/// `joints` [T,55,3], metres, float32, or float64 for --precision double. Returns a line about it.
///
/// Throws UserError or DataError with one message for whatever is wrong with options and files.
std::string pose_command(const PoseOptions& options);

}  // namespace hsi4d::cli
