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

struct GaussianStatistics {
  Index count = 0;
  int sh_degree = 0;
  Vector3<double> lower_world = Vector3<double>::Zero();  ///< smallest coordinates of the means, metres
  Vector3<double> upper_world = Vector3<double>::Zero();  ///< largest, metres
  Distribution opacity;                                   ///< 0 to 1
  Distribution scale;                                     ///< standard deviations along all axes, metres
};

/// Statistics of Gaussians. Throws InternalError as check_sizes.
GaussianStatistics statistics_of(const Gaussians& gaussians);

}  // namespace hsi4d
