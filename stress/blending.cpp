// Rows B: alpha, blending, sorting.
#include "stress/stress.h"

namespace hsi4d {

std::span<const StressCase> blending_cases() { return {}; }

}  // namespace hsi4d
