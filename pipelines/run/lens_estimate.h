// How much the lens of a video bends, as its frame 0 tells it.
#pragma once

#include "pipelines/config/run_config.h"
#include "pipelines/input/clip.h"

namespace hsi4d {

/// What `data.lens.k1` "estimate" comes to.
struct LensEstimate {
  double k1 = 0;
  double psnr_db = 0;      ///< of the background of frame 0, straightened
  bool is_widest = false;  ///< one beyond may be nearer
};

/// The largest |k1| that is looked for.
inline constexpr double kMostBend = 0.5;

/// The k1 with which frame 0, straightened, is nearest to the scene as the given camera sees it: least squared
/// difference where no mask shows the human or an object, and the lens shows something. The other numbers of the lens
/// are as given. To a ten-thousandth, whatever the threads.
/// @param clip  without a lens (set_lens)
LensEstimate estimated_lens(const RunConfig& config, const Clip& clip);

}  // namespace hsi4d
