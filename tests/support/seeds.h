// Seeds of tests that draw random numbers.
#pragma once

#include <cstdint>

namespace hsi4d::test {

/// A seed of this run alone, printed once; HSI4D_TEST_SEED=n repeats it.
std::uint64_t fresh_seed();

}  // namespace hsi4d::test
