#include "autodiff/adjoint_run.h"

#include <array>

#include "autodiff/block_sum.h"
#include "autodiff/blocks.h"
#include "core/simd.h"

namespace hsi4d::detail {

namespace {

template <class S, class W>
void add_to(const AdjointRun<S>& run, const S* p, const W& weight, Index n) {
  S* d = run.d;
  double* slot = run.slot;
  if (slot == nullptr && run.assigns) {
#pragma GCC ivdep
    for (Index i = 0; i < n; ++i) d[i] = p[i] * weight(i);
    return;
  }
  if (slot == nullptr && !run.one_number) {
#pragma GCC ivdep
    for (Index i = 0; i < n; ++i) d[i] += p[i] * weight(i);
    return;
  }
  if (!run.one_number) {
    for (Index i = 0; i < n; ++i) slot[i] += static_cast<double>(p[i] * weight(i));
    return;
  }
  alignas(kAlignment) std::array<S, kBlock> room;
  S* const weighted = room.data();
  for (Index i = 0; i < n; ++i) weighted[i] = p[i] * weight(i);
  if (slot != nullptr) {
    *slot += block_sum(weighted, n);
  } else {
    *d += static_cast<S>(block_sum(weighted, n));
  }
}

}  // namespace

template <class S>
void add_weighted(const AdjointRun<S>& run, const S* partial, const Weights<S>& weights, Index n) {
  on_best_isa_for<S>([&] {
    if (weights.each != nullptr) {
      add_to(
          run, partial, [each = weights.each](Index i) { return each[i]; }, n);
    } else {
      add_to(
          run, partial, [all = weights.all](Index) { return all; }, n);
    }
  });
}

template void add_weighted(const AdjointRun<float>&, const float*, const Weights<float>&, Index);
template void add_weighted(const AdjointRun<double>&, const double*, const Weights<double>&, Index);

}  // namespace hsi4d::detail
