// Gaussians fitted to pictures whose cameras are known.
//
// One picture an iteration, in an order that is new each time that all were seen; the stage's losses, differentiated
// through the renderer; each row of each group moved by Adam (optim/row_adam.h); now and then the density changes
// (pipelines/scan/density.h). A function of settings, pictures and seed alone, for any number of threads and from any
// checkpoint on.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "core/observer.h"
#include "optim/loss_term.h"
#include "pipelines/scan/settings.h"
#include "pipelines/scan/state.h"

namespace hsi4d {

/// Which of `count` pictures are held back.
std::vector<bool> held_photos(const ScanPhotos& settings, std::size_t count);

/// Whether a term of the stage reads depths.
bool reads_depths(const StageSettings& stage);

/// How well pictures are shown: a mean.
struct ScanScore {
  Index pictures = 0;
  double psnr_db = 0, ssim = 0;
};

/// One picture as the result shows it.
struct ScanPicture {
  std::size_t photo = 0;
  bool held = false;
  double psnr_db = 0, ssim = 0;
};

/// Who looks on.
struct ScanWatch {
  Observer observer = {};
  std::function<void(const ScanState&)> save = {};  ///< at checkpoints and where it is stopped; may be empty
};

/// Goes on from a state until the stage's iterations are done. Stopped, it saves, and throws Interrupted.
///
/// @param photos  of one size, or else InternalError
/// @param extent  rates of places are shares of it, metres
/// Throws UserError: no photo that is learnt from, a loss that is not finite; as record_loss.
void fit_scan(const ScanSettings& settings, const std::vector<Photo>& photos, double extent,
              std::span<const LossTerm> terms, const ScanWatch& watch, ScanState& state);

/// All pictures of which something counts, before settings.background, and how near they are to what was seen. Each is
/// shown with its exposure, where the state has some.
/// @param take  called with each picture's image; may be empty
std::vector<ScanPicture> score_scan(const ScanSettings& settings, const std::vector<Photo>& photos,
                                    const ScanState& state,
                                    const std::function<void(const ScanPicture&, const Image&)>& take = {});

/// Means over the held pictures, or over the others.
ScanScore mean_score(const std::vector<ScanPicture>& pictures, bool held);

}  // namespace hsi4d
