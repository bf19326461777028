// `hsi4d bench rasterize`: time and counts of the renderer's steps on made-up workloads.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/types.h"

namespace hsi4d {

/// One step of one workload. Rates follow from the numbers.
struct Measurement {
  std::string name;  ///< "rasterize/WORKLOAD/STEP"
  int threads = 1;
  double median_ms = 0, min_ms = 0;
  int repeats = 0;
  Index gaussians = 0, fragments = 0, groups = 0, pairs = 0, pixels = 0;
  Index tiles = 0;       ///< of which something was rendered
  Index kept_bytes = 0;  ///< of the pixels, from forward to backward, beside the outputs
  /// Of an iteration with skips, against the same without: largest difference of the image, relative L2 of gradients.
  std::optional<double> image_error = {}, gradient_error = {};
};

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
