// How far apart two sets of numbers are: what figures of the stress suite are made of. What is not a number counts as
// infinitely far.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/types.h"

namespace hsi4d::stress {

/// The larger of two errors; what is not a number is larger than any, and so breaks the bound that the largest is held
/// to. (std::max(largest, NaN) is `largest`.)
template <class T>
T larger(T a, T b) {
  return std::isnan(a) || b <= a ? a : b;
}
inline double larger(double a, double b) { return larger<double>(a, b); }

/// The largest of some magnitudes; infinity if one of them is not a number.
class Largest {
 public:
  void add(double magnitude) {
    value_ = std::isnan(magnitude) ? std::numeric_limits<double>::infinity() : std::max(value_, magnitude);
  }
  double value() const { return value_; }

 private:
  double value_ = 0;
};

/// The largest |a − b|; infinity where one has more numbers.
template <class S = double>
double largest_difference(const std::vector<S>& a, const std::vector<S>& b) {
  Largest largest;
  if (a.size() != b.size()) largest.add(std::numeric_limits<double>::infinity());
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i)
    largest.add(std::abs(static_cast<double>(a[i]) - static_cast<double>(b[i])));
  return largest.value();
}

/// The largest |a|.
inline double largest_size(const std::vector<double>& a) {
  return largest_difference(a, std::vector<double>(a.size(), 0.0));
}

/// |a − b| / |b| (L2); |a| where b is zero.
inline double relative_l2(const std::vector<double>& a, const std::vector<double>& b) {
  double difference = a.size() == b.size() ? 0.0 : std::numeric_limits<double>::infinity(), size = 0;
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) {
    difference += (a[i] - b[i]) * (a[i] - b[i]);
    size += b[i] * b[i];
  }
  const double ratio = std::sqrt(difference) / (size > 0 ? std::sqrt(size) : 1);
  return std::isnan(ratio) ? std::numeric_limits<double>::infinity() : ratio;
}

/// How many numbers are not equal.
inline double unequal(const std::vector<double>& a, const std::vector<double>& b) {
  if (a.size() != b.size()) return std::numeric_limits<double>::infinity();
  double count = 0;
  for (std::size_t i = 0; i < a.size(); ++i) count += a[i] == b[i] ? 0 : 1;
  return count;
}

/// How many numbers are infinite or none.
template <class Numbers>
double not_finite(const Numbers& numbers) {
  return static_cast<double>(std::count_if(numbers.begin(), numbers.end(), [](auto x) { return !std::isfinite(x); }));
}

}  // namespace hsi4d::stress
