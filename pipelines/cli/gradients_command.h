// `hsi4d gradients`: how an image's difference from another one depends on every number of a scene.
#pragma once

#include <string>
#include <vector>

#include "pipelines/cli/scene_options.h"

namespace hsi4d::cli {

struct GradientsOptions {
  SceneOptions shared;
  std::string target;  ///< --target F.png, .exr or .npz
  std::string out;     ///< --out grads.npz
};

/// Renders the scene, takes the loss (the mean over H·W·3 of the squared difference from the target) and writes
///
///   loss   image [H,W,3]   alpha [H,W]   means [N,3]   quats [N,4]   log_scales [N,3]   opacity_logits [N]
///   sh [N,K,3]   camera [6]
///
/// where all but the first three are derivatives of the loss. Rows are those of the scene's file; rows that its reader
/// rejects have gradient 0, and so have log-scales and opacity logits that it held at a limit. The loss is float64; the
/// arrays are float32 for --precision float, else float64. Returns what the command prints.
///
/// Throws UserError or DataError with one message for whatever is wrong with options and files.
std::string gradients_command(const GradientsOptions& options);

/// The numbers of a target, [H,W,3], never colour-converted: PNG v/255 or v/65535 without its alpha, the layers R, G, B
/// of OpenEXR, the array `image` of an npz.
///
/// Throws DataError for an image of another size, or without three colours, or with a number that is not finite.
std::vector<double> read_target(const std::string& path, int height, int width);

}  // namespace hsi4d::cli
