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

/// |x| of each row of an array of so many rows (L2).
inline std::vector<double> row_norms(const std::vector<double>& numbers, std::size_t rows) {
  std::vector<double> norms(rows);
  const std::size_t cols = rows > 0 ? numbers.size() / rows : 0;
  for (std::size_t r = 0; r < rows; ++r) {
    double sum = 0;
    for (std::size_t c = 0; c < cols; ++c) sum += numbers[r * cols + c] * numbers[r * cols + c];
    norms[r] = std::sqrt(sum);
  }
  return norms;
}

/// The median of the rows' |x|, of those that are not zero; 0 if all are.
inline double median_row(const std::vector<double>& numbers, std::size_t rows) {
  std::vector<double> norms = row_norms(numbers, rows);
  std::erase(norms, 0.0);
  if (norms.empty()) return 0;
  const auto middle = norms.begin() + static_cast<std::ptrdiff_t>(norms.size() / 2);
  std::nth_element(norms.begin(), middle, norms.end());
  return *middle;
}

/// |a − b| of each row, over |b| of that row or over `least`, whichever is larger; a and b of one size.
inline std::vector<double> row_errors(const std::vector<double>& a, const std::vector<double>& b, std::size_t rows,
                                      double least) {
  std::vector<double> difference(a.size());
  for (std::size_t i = 0; i < a.size(); ++i) difference[i] = a[i] - b[i];
  std::vector<double> errors = row_norms(difference, rows);
  const std::vector<double> sizes = row_norms(b, rows);
  for (std::size_t r = 0; r < rows; ++r) {
    const double scale = std::max(sizes[r], least);
    if (scale > 0) errors[r] /= scale;
  }
  return errors;
}

/// The largest of row_errors, infinity where one has more numbers: sees an error in rows of little weight, which
/// relative_l2 does not see. `least`, the median row say, keeps rounding in rows of nothing out.
inline double worst_row_error(const std::vector<double>& a, const std::vector<double>& b, std::size_t rows,
                              double least) {
  if (a.size() != b.size()) return std::numeric_limits<double>::infinity();
  return largest_size(row_errors(a, b, rows, least));
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
