#include "tests/support/seeds.h"

#include <cstdlib>
#include <iostream>
#include <random>

namespace hsi4d::test {

std::uint64_t fresh_seed() {
  static const std::uint64_t seed = [] {
    const char* wish = std::getenv("HSI4D_TEST_SEED");
    const std::uint64_t value = wish != nullptr ? std::strtoull(wish, nullptr, 10) : std::random_device()();
    std::cout << "fresh seed " << value << " (HSI4D_TEST_SEED=" << value << " repeats it)" << std::endl;
    return value;
  }();
  return seed;
}

}  // namespace hsi4d::test
