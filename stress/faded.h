// What moments that fade cost: row F4.
#pragma once

#include "stress/stress.h"

namespace hsi4d::stress {

/// Time of a step on numbers that had a gradient in the first step alone, over that on numbers that always have one: of
/// both the least of the last thousand, which run in turns, so that what else the machine does hardly counts. By the
/// program's Adam, or a plain loop without the remedy.
/// @param steps  more than a thousand
double slowdown_of_faded(Remedy remedy, int steps);

}  // namespace hsi4d::stress
