// Numbers of a tape's arrays, as the figures of the stress suite take them.
#pragma once

#include <string_view>
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

/// A leaf that holds these numbers, rounded to S.
template <class S, class Numbers = std::vector<double>>
Var<S> leaf(Tape<S>& tape, std::string_view name, const Shape& shape, const Numbers& numbers) {
  const Var<S> var = tape.parameter(name, shape);
  tape.set(var, std::vector<S>(numbers.begin(), numbers.end()));
  return var;
}

/// Writes the numbers of a leaf, rounded to S.
template <class S>
void set_numbers(Tape<S>& tape, Var<S> leaf, const std::vector<double>& numbers) {
  tape.set(leaf, std::vector<S>(numbers.begin(), numbers.end()));
}

}  // namespace hsi4d::stress
