// Rows D: skinning, priors, contacts.
#include "stress/stress.h"

namespace hsi4d {

std::span<const StressCase> body_cases() { return {}; }

}  // namespace hsi4d
