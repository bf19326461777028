// Counts heap allocations of the program, for measurements.
#pragma once

#include <cstdint>
#include <functional>

namespace hsi4d::cli {

/// What tells the calls of operator new so far, by all threads. Empty where they are not counted: under sanitizers,
/// which bring their own.
std::function<std::int64_t()> heap_allocation_counter();

}  // namespace hsi4d::cli
