// `hsi4d render`: an image of Gaussians.
#pragma once

#include <string>
#include <vector>

#include "pipelines/cli/scene_options.h"

namespace hsi4d::cli {

struct RenderOptions {
  SceneOptions shared;
  std::vector<std::string> objects;  ///< --object F.ply, drawn as they lie in their files, or where
  std::string object_poses;          ///< --objects O.npz puts them in that frame, by the names of their files
  std::string motion;                ///< --motion M.npz, with
  int frame = 0;                     ///< --frame I, of poses and motion, and
  std::string avatar;                ///< --avatar F.safetensors: a body drawn in that frame's pose
  std::string color_net;             ///< --color-net F.safetensors: what colours it, in place of the avatar's own
  std::vector<std::string> pixels;   ///< --debug-pixel X,Y: column and row
  std::string out;                   ///< --out F.png, .exr or .npz
};

/// Renders what is given of scene, objects and body, and writes the image. PNG: 8 bit, clamped. EXR: R, G, B as float.
/// npz: `image` [H,W,3], `alpha` [H,W] and `depth` [H,W], float32 for --precision float, else float64. Returns what the
/// command prints: what made each of `pixels`, and a line about the image.
///
/// Throws UserError or DataError with one message for whatever is wrong with options and files.
std::string render_command(const RenderOptions& options);

}  // namespace hsi4d::cli
