// Operators that `hsi4d bench tape` times beside the tape itself: those with a goal of their own.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/types.h"

namespace hsi4d {

/// Something that is timed, ready to be run again and again.
struct TapeWork {
  std::string name;                 ///< "tape/WORKLOAD/STEP"
  Index nodes = 0;                  ///< of a chain; 0: a loss
  Index elements = 0;               ///< of a loss; 0: a chain
  std::string against = {};         ///< the name of the work that its time is divided by; empty: none
  std::optional<double> goal = {};  ///< the most that is asked for: nanoseconds a node or element, or the ratio
  std::function<void()> run;
};

namespace detail {

/// `ssim/both`: D-SSIM of 1024 × 1024 × 3, forward and backward; an element is a pixel.
void add_ssim(std::vector<TapeWork>& work);

/// `skinning/primal`, `skinning/gradient`: 2000 vertices of 4 joints each, in double.
void add_skinning(std::vector<TapeWork>& work);

/// `anomaly/off`, `anomaly/on`: an iteration of a photometric loss without and with Tape::set_anomaly.
void add_anomaly(std::vector<TapeWork>& work);

}  // namespace detail

}  // namespace hsi4d
