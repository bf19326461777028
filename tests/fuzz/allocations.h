// The largest piece of memory that was asked for: readers check the counts that a file claims before they take memory.
#pragma once

#include <cstddef>

namespace hsi4d::fuzz {

/// Forgets what was asked for so far.
void forget_allocations();

/// Bytes of the largest allocation since then, by whichever library; 0 where sanitizers have malloc for themselves.
std::size_t largest_allocation();

}  // namespace hsi4d::fuzz
