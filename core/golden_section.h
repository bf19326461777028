// The number at which a function of one number is largest.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

namespace hsi4d {

/// An interval of numbers.
struct Bracket {
  double low = 0, high = 0;
};

/// Where `value` is largest in a bracket: looked for in equal steps, then by golden sections about the best of these
/// [Kiefer 1953]. Of two equal values that at the smaller number counts.
///
/// @param steps    of the first look, at least 1
/// @param value    double(double)
/// @param is_fine  bool(Bracket): whether it may end
template <class Value, class IsFine>
Bracket bracket_of_largest(const Bracket& within, int steps, Value&& value, IsFine&& is_fine) {
  const auto number_at = [&](int step) { return within.low + (within.high - within.low) * step / steps; };
  int best = 0;
  double most = -HUGE_VAL;
  for (int step = 0; step <= steps; ++step) {
    const double there = value(number_at(step));
    if (there > most) best = step, most = there;
  }
  Bracket found{number_at(std::max(0, best - 1)), number_at(std::min(steps, best + 1))};
  constexpr double kGolden = 1 / std::numbers::phi;
  const auto left_of = [&] { return found.high - kGolden * (found.high - found.low); };
  const auto right_of = [&] { return found.low + kGolden * (found.high - found.low); };
  double left = left_of(), right = right_of(), at_left = value(left), at_right = value(right);
  while (!is_fine(found)) {
    if (at_left > at_right) {
      found.high = right, right = left, at_right = at_left;
      left = left_of();
      at_left = value(left);
    } else {
      found.low = left, left = right, at_left = at_right;
      right = right_of();
      at_right = value(right);
    }
  }
  return found;
}

}  // namespace hsi4d
