// The processor's peak rate of fused multiply-adds, to which other figures are compared.
#include <benchmark/benchmark.h>

#include "bench/goals.h"
#include "core/fma_peak.h"

namespace hsi4d::bench {
namespace {

template <class S>
void fma_peak(benchmark::State& state) {
  FmaBurst<S> burst;
  Index count = 0;
  for (auto _ : state) count = burst.run();
  state.counters["fma"] = static_cast<double>(count);
}

[[maybe_unused]] const auto* float_peak = benchmark::RegisterBenchmark(kPeakFloat, fma_peak<float>);
[[maybe_unused]] const auto* double_peak = benchmark::RegisterBenchmark(kPeakDouble, fma_peak<double>);

}  // namespace
}  // namespace hsi4d::bench
