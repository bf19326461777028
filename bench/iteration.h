// Part of `hsi4d bench rasterize`: an iteration in which some Gaussians move and the rest stands still, with each exact
// skip on and off.
#pragma once

#include <functional>

#include "bench/measurement.h"
#include "bench/topic.h"
#include "bench/workloads.h"

namespace hsi4d {

/// Measures forward and backward of `workload` with all of moving_begin … count moved a little before each run; in the
/// same rounds with everything skipped that can be, and with less. `report` gets each measurement; those with skips
/// tell how far image and gradients are from those without.
void bench_iteration(const Workload& workload, const cli::BenchOptions& options,
                     const std::function<void(const Measurement&)>& report);

}  // namespace hsi4d
