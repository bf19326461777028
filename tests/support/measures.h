// How far apart numbers are: the measures of the stress suite, for tests.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "stress/measures.h"

namespace hsi4d::test {

using stress::larger;
using stress::largest_difference;
using stress::relative_l2;

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

/// The largest |a − b| of a row, over |b| of that row or over `least`, whichever is larger: sees an error in rows of
/// little weight, which relative_l2 does not see. `least`, the median row, keeps rounding in rows of nothing out.
inline double worst_row_error(const std::vector<double>& a, const std::vector<double>& b, std::size_t rows,
                              double least) {
  if (a.size() != b.size()) return std::numeric_limits<double>::infinity();
  std::vector<double> difference(a.size());
  for (std::size_t i = 0; i < a.size(); ++i) difference[i] = a[i] - b[i];
  const std::vector<double> off = row_norms(difference, rows), size = row_norms(b, rows);
  stress::Largest worst;
  for (std::size_t r = 0; r < rows; ++r) {
    const double scale = std::max(size[r], least);
    worst.add(scale > 0 ? off[r] / scale : off[r]);
  }
  return worst.value();
}

}  // namespace hsi4d::test
