// A sum in the order of threads, as programs have it that give each thread a share of the pixels and a sum of its own:
// what the partitions of core/parallel.h are there to avoid.
#pragma once

#include "autodiff/tape.h"
#include "core/parallel.h"

namespace hsi4d::stress {

/// y = x + o for a number o; d_o = Σ d_y in as many shares as there are threads, in S.
template <class S>
struct OffsetByThreads {
  static constexpr const char* kName = "offset_by_threads";
  void forward(NodeIo<S>& io) {
    const ConstArray<S> x = io.in(0);
    const S offset = io.in(1).scalar();
    for (Index r = 0; r < x.total_rows(); ++r) {
      for (Index c = 0; c < x.shape.cols; ++c) io.out().row(r)[c] = x.row(r)[c] + offset;
    }
  }
  void backward(NodeIo<S>& io) {
    const ConstArray<S> d_y = io.d_out();
    const Index rows = d_y.total_rows(), threads = thread_count();
    S total = 0;
    for (Index t = 0; t < threads; ++t) {
      S share = 0;
      for (Index r = rows * t / threads; r < rows * (t + 1) / threads; ++r) {
        for (Index c = 0; c < d_y.shape.cols; ++c) {
          if (io.wants(0)) io.d_in(0).row(r)[c] += d_y.row(r)[c];
          share += d_y.row(r)[c];
        }
      }
      total += share;
    }
    if (io.wants(1)) io.d_in(1).scalar() += total;
  }
};

template <class S>
Var<S> offset_by_threads(Var<S> x, Var<S> offset) {
  return x.owner().record(OffsetByThreads<S>{}, {x, offset}, x.shape(), Source::current());
}

}  // namespace hsi4d::stress
