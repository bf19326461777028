// What is in a set of Gaussians, in a few numbers.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "splat/gaussians.h"

namespace hsi4d {

/// Order statistics, by nearest rank; all zero without numbers.
struct Distribution {
  double smallest = 0, percentile_5 = 0, median = 0, percentile_95 = 0, largest = 0;
};

/// The distribution of `values`, which are put in order.
Distribution distribution_of(std::vector<float> values);

/// Counts of numbers in intervals: bin i holds those from edges[i] to below edges[i + 1], the last one also its end.
struct Histogram {
  std::vector<double> edges;
  std::vector<Index> counts;
};

/// The histogram of `values` over ascending edges; numbers beyond the ends are counted in the end bins.
Histogram histogram_of(std::span<const float> values, std::vector<double> edges);

/// Gaussians that are allowed and seldom meant.
struct Suspicions {
  Index duplicates = 0;   ///< at exactly the place of an earlier one
  Index transparent = 0;  ///< an opacity below kAlphaMin, 1/255: not drawn unless render.alpha_min is lowered
  Index huge = 0;         ///< a standard deviation above the diagonal of the box of the middle 90 % of the means
  Index needles = 0;      ///< the longest axis kNeedleAspect times the second longest, or more
};
inline constexpr double kNeedleAspect = 100;

struct GaussianStatistics {
  Index count = 0;
  int sh_degree = 0;
  Vector3<double> lower_world = Vector3<double>::Zero();  ///< smallest coordinates of the means, metres
  Vector3<double> upper_world = Vector3<double>::Zero();  ///< largest, metres
  Distribution opacity;                                   ///< 0 to 1
  Distribution scale;                                     ///< standard deviations along all axes, metres
  Histogram opacity_histogram;                            ///< ten equal bins from 0 to 1
  Histogram scale_histogram;                              ///< a bin a power of ten, metres
  Suspicions suspicions;
};

/// Statistics of Gaussians. Throws InternalError as check_sizes.
GaussianStatistics statistics_of(const Gaussians& gaussians);

}  // namespace hsi4d
