// The processor's peak rate of fused multiply-adds, to which other figures are compared.
#pragma once

#include <array>

#include "core/types.h"

namespace hsi4d {

/// Fused multiply-adds on numbers that stay in registers: acc ← acc x + y over independent vectors of acc, by the best
/// instruction set.
template <class S>
class FmaBurst {
 public:
  /// Returns how many multiply-adds were done, lanes counted; 0, and does nothing, where the instruction set has none.
  Index run();

 private:
  std::array<S, 1024> sums_{};  // room for the accumulators of the widest vectors
  S x_ = S(0.999), y_ = S(0.001);
};

extern template class FmaBurst<float>;
extern template class FmaBurst<double>;

/// Multiply-adds a second, lanes counted, of float on all threads of the current scope: the greatest of some tries, 50
/// ms in all. 0 where the instruction set has none.
double fma_peak_per_second();

}  // namespace hsi4d
