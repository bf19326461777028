#include "bench/measurement.h"

#include "bench/workloads.h"
#include "core/memory.h"
#include "splat/render/render_counters.h"

namespace hsi4d {

Index Measurement::work() const {
  return unit == WorkUnit::kGaussians ? gaussians : unit == WorkUnit::kPairs ? pairs : fragments;
}

double Measurement::millions_per_s() const { return median_ms > 0 ? static_cast<double>(work()) / median_ms / 1e3 : 0; }

std::optional<double> Measurement::peak_share() const {
  if (!(operations > 0 && fma_peak_per_s > 0 && min_ms > 0)) return std::nullopt;
  return operations / (1e-3 * min_ms) / fma_peak_per_s;
}

Measurement measured(const Workload& workload, const RenderCounters& counters, int threads, const std::string& step,
                     const std::vector<double>& seconds) {
  Measurement m{bench_time("rasterize/" + workload.name + "/" + step, threads, seconds)};
  m.gaussians = workload.count;
  m.fragments = counters.fragments;
  m.pairs = counters.pairs;
  m.groups = counters.groups;
  m.tiles = counters.tiles;
  m.kept_bytes = counters.kept_bytes;
  m.pixels = static_cast<Index>(workload.view.camera.width) * workload.view.camera.height;
  m.peak_memory_bytes = peak_memory_bytes();
  return m;
}

}  // namespace hsi4d
