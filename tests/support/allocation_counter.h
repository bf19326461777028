// Counts heap allocations of the whole process, in every library and thread, by standing in for malloc.
#pragma once

#include <cstdint>

#include "core/types.h"

namespace hsi4d::test {

/// False under sanitizers, which bring their own malloc: allocation tests then do not apply.
bool allocations_are_counted();

/// Calls of malloc, calloc, realloc, aligned_alloc, posix_memalign and memalign so far.
std::int64_t allocation_count();

/// Heap allocations of a round of iterations in the steady state. A first round warms up. On one thread the next one
/// counts; on several the scheduler may start a worker only now, so up to ten rounds are tried and the least counts:
/// what allocates in every iteration is found all the same.
std::int64_t steady_allocations(FunctionRef<void()> round);

}  // namespace hsi4d::test
