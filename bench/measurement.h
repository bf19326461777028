// What one measurement of `hsi4d bench rasterize` holds, and how it is filled.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "bench/timing.h"
#include "core/types.h"

namespace hsi4d {

struct RenderCounters;
struct Workload;

/// What a step's rate counts.
enum class WorkUnit { kGaussians, kPairs, kFragments };

/// One step of one workload. Rates follow from the numbers.
struct Measurement : BenchTime {
  Index gaussians = 0, fragments = 0, groups = 0, pairs = 0, pixels = 0;
  Index tiles = 0;       ///< of which something was rendered
  Index kept_bytes = 0;  ///< of the pixels, from forward to backward, beside the outputs
  WorkUnit unit = WorkUnit::kFragments;
  double operations = 0;        ///< of one run on vector ports, lanes counted; 0: not counted
  double fma_peak_per_s = 0;    ///< measured just before, on as many threads; 0: no multiply-adds
  Index peak_memory_bytes = 0;  ///< of the process until then
  /// Of an iteration with skips, against the same without: largest difference of the image, relative L2 of gradients.
  std::optional<double> image_error = {}, gradient_error = {};

  /// Units of work of one run.
  Index work() const;
  /// Millions of them a second, by the median.
  double millions_per_s() const;
  /// Operations a second by the least time, as a share of the peak; none where one of the two is not known.
  std::optional<double> peak_share() const;
};

/// The measurement of a step of a workload.
/// @param seconds  of each run, in any order, at least one
Measurement measured(const Workload& workload, const RenderCounters& counters, int threads, const std::string& step,
                     const std::vector<double>& seconds);

}  // namespace hsi4d
