// The cases of rows F by topic; arithmetic.cpp has the list of them.
#pragma once

#include <vector>

#include "stress/stress.h"

namespace hsi4d::stress {

// optimiser.cpp
std::vector<StressFigure> bad_gradients(Remedy remedy);     ///< F1
std::vector<StressFigure> place_of_eps(Remedy remedy);      ///< F2
std::vector<StressFigure> bias_corrections(Remedy remedy);  ///< F3
std::vector<StressFigure> fading_moments(Remedy remedy);    ///< F4
// sums.cpp
std::vector<StressFigure> sums_by_threads(Remedy remedy);   ///< F6
std::vector<StressFigure> sums_over_pixels(Remedy remedy);  ///< F7
std::vector<StressFigure> half_precision(Remedy remedy);    ///< F8
// tape_faults.cpp
std::vector<StressFigure> products_with_vectors(Remedy remedy);  ///< F9
std::vector<StressFigure> rows_not_drawn(Remedy remedy);         ///< F15
std::vector<StressFigure> wrong_but_finite(Remedy remedy);       ///< F16
// files.cpp
std::vector<StressFigure> broken_ply(Remedy remedy);       ///< F11
std::vector<StressFigure> numbers_in_json(Remedy remedy);  ///< F12

}  // namespace hsi4d::stress
