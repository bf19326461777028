// Rows F: tape, Adam, arithmetic, determinism, build.
#include "stress/stress.h"

namespace hsi4d {

std::span<const StressCase> arithmetic_cases() { return {}; }

}  // namespace hsi4d
