// `hsi4d bench color_net`: time of a human's color net on the tape, forward and backward.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "core/types.h"

namespace hsi4d {

/// One step of one workload.
struct ColorNetMeasurement {
  /// "color_net/WORKLOAD/STEP": `forward`; `both`, forward and backward with all that may move; `pose`, the same with
  /// network and features frozen, as between the network's steps.
  std::string name;
  int threads = 1;
  double median_ms = 0, min_ms = 0;
  int repeats = 0;
  Index gaussians = 0, features = 0, hidden_width = 0, hidden_layers = 0;
  double multiply_adds = 0;   ///< of the matrices, those that the backward pass repeats included
  double fma_peak_per_s = 0;  ///< measured just before, on as many threads; 0: no multiply-adds

  /// Multiply-adds a second by the least time, as a share of the peak; 0 where that is not known.
  double peak_share() const;
};

/// What is measured.
struct ColorNetBench {
  std::vector<std::string> workloads;  ///< names; empty: all
  int threads = 1;
  int repeats = 9;  ///< of each, after some to warm up
};

/// Names of the workloads.
std::vector<std::string> color_net_workloads();

/// Measures every workload asked for: 50,000 Gaussians with 16 features, in float. `report` gets each measurement as it
/// is made. Throws UserError for a workload that is not known.
void bench_color_net(const ColorNetBench& options, const std::function<void(const ColorNetMeasurement&)>& report);

}  // namespace hsi4d
