// Numbers in double on a tape of either precision.
#pragma once

#include <algorithm>
#include <vector>

#include "autodiff/tape.h"
#include "core/check.h"

namespace hsi4d {

/// Writes numbers into a leaf, row by row. Throws InternalError where they are not as many as it holds.
template <class S>
void write_rows(Var<S> leaf, const std::vector<double>& numbers) {
  const Array<S> array = leaf.owner().write(leaf);
  HSI4D_CHECK_EQ(array.shape.count(), std::ssize(numbers));
  std::transform(numbers.begin(), numbers.end(), array.data, [](double x) { return static_cast<S>(x); });
}

/// A constant of such rows.
template <class S>
Var<S> constant_rows(Tape<S>& tape, const char* name, const std::vector<double>& numbers, Index cols) {
  const Var<S> leaf = tape.constant(name, shape_of(std::ssize(numbers) / cols, cols));
  write_rows(leaf, numbers);
  return leaf;
}

}  // namespace hsi4d
