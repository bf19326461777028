// Numbers of a tape's arrays, as the figures of the stress suite take them.
#pragma once

#include <vector>

#include "autodiff/tape.h"

namespace hsi4d::stress {

/// The numbers of an array, row by row, without padding.
template <class S>
std::vector<double> numbers_of(const ConstArray<S>& a) {
  std::vector<double> result;
  result.reserve(static_cast<std::size_t>(a.shape.count()));
  for (Index r = 0; r < a.total_rows(); ++r) result.insert(result.end(), a.row(r), a.row(r) + a.shape.cols);
  return result;
}

/// Writes the numbers of a leaf, rounded to S.
template <class S>
void set_numbers(Tape<S>& tape, Var<S> leaf, const std::vector<double>& numbers) {
  tape.set(leaf, std::vector<S>(numbers.begin(), numbers.end()));
}

}  // namespace hsi4d::stress
