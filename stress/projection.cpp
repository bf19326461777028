// Rows A: projection, covariance.
#include "stress/stress.h"

namespace hsi4d {

std::span<const StressCase> projection_cases() { return {}; }

}  // namespace hsi4d
