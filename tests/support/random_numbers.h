// Numbers for tests whose values do not matter.
#pragma once

#include <cstdint>
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

}  // namespace hsi4d
