// Rows E: losses.
#include "stress/stress.h"

namespace hsi4d {

std::span<const StressCase> loss_cases() { return {}; }

}  // namespace hsi4d
