// Operators that `hsi4d bench tape` times beside the tape itself: those with a goal of their own.
#pragma once

#include <vector>

#include "bench/tape.h"

namespace hsi4d::detail {

/// `ssim/both`: D-SSIM of 1024 × 1024 × 3, forward and backward; an element is a pixel.
void add_ssim(std::vector<TapeWork>& work);

/// `skinning/primal`, `skinning/gradient`: 2000 vertices of 4 joints each, in double.
void add_skinning(std::vector<TapeWork>& work);

/// `anomaly/off`, `anomaly/on`: an iteration of a photometric loss without and with Tape::set_anomaly.
void add_anomaly(std::vector<TapeWork>& work);

}  // namespace hsi4d::detail
