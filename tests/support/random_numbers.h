// Numbers for tests whose values do not matter.
#pragma once

#include <cstdint>
#include <random>
#include <vector>

#include "core/random.h"
#include "core/types.h"

namespace hsi4d {

/// Numbers in [−size, size), the same for a seed.
inline std::vector<double> random_numbers(Index count, double size, std::uint64_t seed) {
  const Random random(seed);
  std::vector<double> numbers(static_cast<std::size_t>(count));
  for (std::size_t i = 0; i < numbers.size(); ++i) numbers[i] = random.uniform(i, -size, size);
  return numbers;
}

namespace test {

using Numbers = std::vector<double>;

/// Uniform numbers of a seed.
class RandomNumbers {
 public:
  explicit RandomNumbers(std::uint64_t seed) : random_(seed) {}
  double operator()(double low = -1, double high = 1) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  Numbers numbers(std::size_t count, double size = 1) {
    Numbers all(count);
    for (double& x : all) x = (*this)(-size, size);
    return all;
  }

 private:
  std::mt19937_64 random_;
};

}  // namespace test

}  // namespace hsi4d
