// What tests take the largest error with.
#pragma once

#include <cmath>

namespace hsi4d::test {

/// The larger of two errors; what is not a number is larger than any, and so breaks the bound that the largest is held
/// to. (std::max(largest, NaN) is `largest`.)
template <class T>
T larger(T a, T b) {
  return std::isnan(a) || b <= a ? a : b;
}

}  // namespace hsi4d::test
