#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "bench/fma_peak.cpp"
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_SSE4 | HWY_AVX3_DL)
// clang-format off
#include <hwy/foreach_target.h>
// clang-format on
#include "bench/fma_peak.h"

#include <algorithm>
#include <vector>

#include <hwy/highway.h>

#include "core/parallel.h"
#include "core/simd.h"
#include "core/stopwatch.h"

HWY_BEFORE_NAMESPACE();
namespace hsi4d::detail::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// Ten accumulators hide a latency of five cycles at two multiply-adds a cycle, and fit into 16 registers with x and y.
/// They are named one by one: g++ 12 keeps one of an array in memory.
template <class S>
Index burst(S* sums, S x_number, S y_number) {
#if HWY_NATIVE_FMA
  constexpr Index kRounds = 3000;
  const hn::CappedTag<S, 64 / sizeof(S)> d;
  const auto lanes = static_cast<Index>(hn::Lanes(d));
  const auto x = hn::Set(d, x_number), y = hn::Set(d, y_number);
  const auto at = [&](Index i) { return hn::LoadU(d, sums + i * lanes); };
  auto a = at(0), b = at(1), c = at(2), e = at(3), f = at(4), g = at(5), h = at(6), i = at(7), j = at(8), k = at(9);
  for (Index r = 0; r < kRounds; ++r) {
    a = hn::MulAdd(a, x, y);
    b = hn::MulAdd(b, x, y);
    c = hn::MulAdd(c, x, y);
    e = hn::MulAdd(e, x, y);
    f = hn::MulAdd(f, x, y);
    g = hn::MulAdd(g, x, y);
    h = hn::MulAdd(h, x, y);
    i = hn::MulAdd(i, x, y);
    j = hn::MulAdd(j, x, y);
    k = hn::MulAdd(k, x, y);
  }
  Index place = 0;
  for (const auto& sum : {a, b, c, e, f, g, h, i, j, k}) hn::StoreU(sum, d, sums + lanes * place++);
  return place * lanes * kRounds;
#else
  return 0 * static_cast<Index>(sums == nullptr || x_number < y_number);
#endif
}

Index burst_float(float* sums, float x, float y) { return burst(sums, x, y); }
Index burst_double(double* sums, double x, double y) { return burst(sums, x, y); }

}  // namespace hsi4d::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace hsi4d {
namespace detail {
HWY_EXPORT(burst_float);
HWY_EXPORT(burst_double);

Index best_burst(float* sums, float x, float y) { return HWY_DYNAMIC_DISPATCH(burst_float)(sums, x, y); }
Index best_burst(double* sums, double x, double y) { return HWY_DYNAMIC_DISPATCH(burst_double)(sums, x, y); }

}  // namespace detail

template <class S>
Index FmaBurst<S>::run() {
  best_isa();  // holds Highway to it
  return detail::best_burst(sums_.data(), x_, y_);
}

template class FmaBurst<float>;
template class FmaBurst<double>;

double fma_peak_per_second() {
  constexpr int kTries = 10, kBursts = 500;
  std::vector<FmaBurst<float>> bursts(static_cast<std::size_t>(thread_count()));
  std::vector<Index> counts(bursts.size());
  double best = 0;
  for (int i = 0; i < kTries; ++i) {
    Stopwatch watch;
    run_chunks(std::ssize(bursts), [&](Index chunk) {
      const auto at = static_cast<std::size_t>(chunk);
      counts[at] = 0;
      for (int b = 0; b < kBursts; ++b) counts[at] += bursts[at].run();
    });
    Index all = 0;
    for (const Index count : counts) all += count;
    best = std::max(best, static_cast<double>(all) / watch.lap());
  }
  return best;
}

}  // namespace hsi4d
#endif
