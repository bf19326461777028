// Counts heap allocations of the whole process, in every library and thread, by standing in for malloc.
#pragma once

#include <cstdint>

namespace hsi4d::test {

/// False under sanitizers, which bring their own malloc: allocation tests then do not apply.
bool allocations_are_counted();

/// Calls of malloc, calloc, realloc, aligned_alloc, posix_memalign and memalign so far.
std::int64_t allocation_count();

}  // namespace hsi4d::test
