// What a handful of numbers tells: mean, spread, and how far off a mean may be.
#pragma once

#include <optional>
#include <span>

#include "core/types.h"

namespace hsi4d {

/// Mean and standard deviation of a sample.
struct SampleStatistics {
  std::size_t count = 0;
  double mean = 0;
  double deviation = 0;  ///< with n − 1; 0 of fewer than two
};

/// Of any number of values; of none all is 0.
SampleStatistics sample_statistics(std::span<const double> values);

/// A range that a number is in.
struct Interval {
  double low = 0, high = 0;
  bool contains(double value) const { return low <= value && value <= high; }
};

/// The value at `share` of sorted values, between neighbours linearly: order statistics at h = (n − 1) p.
/// [Hyndman and Fan 1996, type 7]. Throws InternalError for none.
double quantile(std::span<const double> sorted, double share);

/// The interval of the mean of `values` by the bootstrap: means of samples of the same size drawn with replacement, cut
/// off at both ends to `confidence` (percentile method).                                     [Efron and Tibshirani
/// 1993, §13.3]
///
/// The same values give the same bits. Of few values it is narrower than it should be: of three, a mean of them that a
/// repetition would not reach is possible.
/// @return  nothing for fewer than two values
std::optional<Interval> bootstrap_interval(std::span<const double> values, double confidence = 0.95,
                                           Index samples = 10000);

}  // namespace hsi4d
