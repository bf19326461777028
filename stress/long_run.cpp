// Rows L: 10,000 steps of Adam.
#include "stress/stress.h"

namespace hsi4d {

std::span<const StressCase> long_run_cases() { return {}; }

}  // namespace hsi4d
