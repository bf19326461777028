// The camera of a picture of a scene, found by rendering: from many starts about a guess, small pictures first.
//
//   1. starts spread about the guess; each is drawn once in a small picture
//   2. the best of them are moved by BFGS (optim/quasi_newton.h) until L = (1 − λ) L1 + λ (1 − SSIM) is least, over the
//      pixels that count
//   3. of those that end in different places the best go on in a picture twice as large, and so on
//
// A function of its arguments alone, the same bits for any number of threads.
#pragma once

#include <array>
#include <vector>

#include "core/camera.h"
#include "core/image.h"
#include "core/observer.h"
#include "splat/gaussians.h"
#include "splat/render_settings.h"

namespace hsi4d {

/// How it is looked for.
struct CameraSearch {
  double spread_m = 0.2, spread_deg = 10;  ///< how far starts are from the guess, at most
  Index starts = 256;                      ///< the guess is the first of them
  int longest_side = 512;                  ///< pixels of the largest picture that is compared
  bool moves_focal = false;                ///< the focal length too
  std::array<double, 3> background = {0, 0, 0};
  RenderSettings render = {};
};

/// What was found.
struct FoundCamera {
  Camera camera;                  ///< of the guess's size
  Index tried = 0, agreeing = 0;  ///< starts that were fitted in the smallest picture, and those that ended near it
};

/// Looks for it. Where nothing better than the guess is found, the guess stays.
///
/// @param guess   a camera of the picture's shape; its size is that of the result
/// @param color   [3,H,W] the picture, not smaller than the guess's size
/// @param weight  [1,H,W], 1 where a pixel counts, else 0; empty: all do
/// Throws UserError where no pixel counts in the smallest picture; Interrupted.
FoundCamera find_camera(const Gaussians& scene, const Camera& guess, const Image& color, const Image& weight,
                        const CameraSearch& search, const Observer& observer = {});

/// The picture beside what a camera sees, in the size of the largest picture that is compared.
struct ComparedCamera {
  Image picture, render;  ///< [3,H,W]
  Image weight;           ///< [1,H,W]; empty: all pixels count
  double psnr_db = 0;     ///< of those that count
};

/// Compares a camera with the picture. Arguments as find_camera has them.
ComparedCamera compare_camera(const Gaussians& scene, const Camera& camera, const Image& color, const Image& weight,
                              const CameraSearch& search);

/// Frame, render and difference side by side; what does not count is black in the last. [3,H,3W]
Image comparison_image(const ComparedCamera& compared);

/// Cameras about a guess, the first the guess itself: their centres within `metres` of its, turned by up to `degrees`
/// about them, both evenly in a ball.
std::vector<Camera> spread_cameras(const Camera& guess, Index count, double metres, double degrees);

}  // namespace hsi4d
