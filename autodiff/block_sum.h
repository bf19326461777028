// Sums of a few hundred numbers, the same bits on every instruction set.
#pragma once

#include "core/types.h"

namespace hsi4d::detail {

/// Sum of a block's numbers in double: 32 running sums (enough to hide the latency of an addition), combined in a fixed
/// order on every instruction set.
template <class S>
double block_sum(const S* y, Index n) {
  constexpr Index kSums = 32;
  double total = 0;
  Index i = 0;
  if (n >= kSums) {
    double sums[kSums] = {};
    for (; i + kSums <= n; i += kSums) {
      for (Index lane = 0; lane < kSums; ++lane) sums[lane] += static_cast<double>(y[i + lane]);
    }
    for (Index half = kSums / 2; half > 0; half /= 2) {
      for (Index lane = 0; lane < half; ++lane) sums[lane] += sums[lane + half];
    }
    total = sums[0];
  }
  for (; i < n; ++i) total += static_cast<double>(y[i]);
  return total;
}

}  // namespace hsi4d::detail
