// The processor's peak rate of fused multiply-adds, to which other figures are compared.
#include <benchmark/benchmark.h>

#include "bench/goals.h"
#include "core/simd.h"

namespace hsi4d::bench {
namespace {

constexpr int kChains = 512;  // independent sums: more than latency × width of any processor
constexpr int kRounds = 1000;

/// acc ← acc · x + y over many independent accumulators that stay in registers by groups.
template <class S>
void multiply_add_rounds(S* sums, S x, S y) {
  constexpr int kGroup = 128;
  for (int g = 0; g < kChains; g += kGroup) {
    S acc[kGroup];
    for (int i = 0; i < kGroup; ++i) acc[i] = sums[g + i];
    for (int r = 0; r < kRounds; ++r) {
      for (int i = 0; i < kGroup; ++i) {
        if constexpr (sizeof(S) == 4) {
          acc[i] = __builtin_fmaf(acc[i], x, y);
        } else {
          acc[i] = __builtin_fma(acc[i], x, y);
        }
      }
    }
    for (int i = 0; i < kGroup; ++i) sums[g + i] = acc[i];
  }
}

template <class S>
void fma_peak(benchmark::State& state) {
  alignas(64) S sums[kChains] = {};
  S x = S(0.999), y = S(0.001);
  for (auto _ : state) {
    benchmark::DoNotOptimize(x);
    benchmark::DoNotOptimize(y);
    on_best_isa([&] { multiply_add_rounds(sums, x, y); });
    benchmark::DoNotOptimize(sums);
    benchmark::ClobberMemory();
  }
  state.counters["fma"] = static_cast<double>(kChains) * kRounds;
}

[[maybe_unused]] const auto* float_peak = benchmark::RegisterBenchmark(kPeakFloat, fma_peak<float>);
[[maybe_unused]] const auto* double_peak = benchmark::RegisterBenchmark(kPeakDouble, fma_peak<double>);

}  // namespace
}  // namespace hsi4d::bench
