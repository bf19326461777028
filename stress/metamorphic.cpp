// Rows R: relations that every render has to keep.
#include "stress/stress.h"

namespace hsi4d {

std::span<const StressCase> metamorphic_cases() { return {}; }

}  // namespace hsi4d
