// `hsi4d bench rasterize`: time and counts of the renderer's steps on made-up workloads.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "bench/measurement.h"

namespace hsi4d {

struct RasterizeBench {
  std::vector<std::string> workloads;  ///< names; empty: all
  int threads = 1;
  int repeats = 9;
};

/// Names of the workloads.
std::vector<std::string> rasterize_workloads();

/// Measures every workload asked for; `report` gets each measurement as it is made. Throws UserError for a workload
/// that is not known.
void bench_rasterize(const RasterizeBench& options, const std::function<void(const Measurement&)>& report);

}  // namespace hsi4d
