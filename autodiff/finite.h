// Fast search for numbers that are not finite.
#pragma once

#include "autodiff/array.h"

namespace hsi4d {

/// Position (row-major, padding not counted) of the first NaN or infinity, or −1. Looks at the bits: right under any
/// compiler flags.
template <class S>
Index first_non_finite(const ConstArray<S>& numbers);

extern template Index first_non_finite(const ConstArray<float>&);
extern template Index first_non_finite(const ConstArray<double>&);

}  // namespace hsi4d
