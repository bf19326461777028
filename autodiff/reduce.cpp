#include "autodiff/reduce.h"

#include <cmath>

#include "autodiff/elementwise.h"
#include "autodiff/map.h"

namespace hsi4d {

namespace {

/// Rows of one parallel chunk for rows of `cols` numbers.
Index rows_grain(Index cols) { return std::max<Index>(1, kChunkNumbers / std::max<Index>(1, cols)); }

/// sum = scale · Σ x.   d_x = scale · d_sum everywhere.
template <class S>
struct SumOp {
  static constexpr const char* kName = "sum";
  static constexpr bool kAssigns = true;
  double scale = 1;

  void forward(NodeIo<S>& io) {
    const ConstArray<S> x = io.in(0);
    const auto walk = detail::walk_inputs<S, 1>(io, x.shape);
    const Partition part = walk.partition();
    const double total = parallel_sum(part.n, part.grain, [&](Index begin, Index end) {
      double partial = 0;
      on_best_isa([&] {
        walk.run(begin, end, [&](const Block<S, 1>& block) { partial += detail::block_sum(block.x[0], block.n); });
      });
      return partial;
    });
    io.out().scalar() = static_cast<S>(scale * total);
  }
  void backward(NodeIo<S>& io) {
    const Array<S> d_x = io.d_in(0);
    const S d = static_cast<S>(scale * static_cast<double>(io.d_out().scalar()));
    const bool assign = io.must_assign(0);
    parallel_for(d_x.total_rows(), rows_grain(d_x.shape.cols), [&](Index begin, Index end) {
      for (Index r = begin; r < end; ++r) {
        S* row = d_x.row(r);
        if (assign) {
          std::fill_n(row, d_x.shape.cols, d);
        } else {
          for (Index c = 0; c < d_x.shape.cols; ++c) row[c] += d;
        }
      }
    });
  }
};

/// y_c = Σ_r x_rc.   d_x_rc = d_y_c.
template <class S>
struct SumRowsOp {
  static constexpr const char* kName = "sum_rows";

  void forward(NodeIo<S>& io) {
    const ConstArray<S> x = io.in(0);
    const Index cols = x.shape.cols;
    const Partition part = reduction_partition(x.total_rows(), rows_grain(cols));
    const std::span<double> slots = io.template scratch<double>(std::max<Index>(1, part.chunks()) * cols);
    std::fill(slots.begin(), slots.end(), 0.0);
    parallel_chunks(part, [&](Index chunk, Index begin, Index end) {
      double* slot = slots.data() + chunk * cols;
      for (Index r = begin; r < end; ++r) {
        for (Index c = 0; c < cols; ++c) slot[c] += static_cast<double>(x.row(r)[c]);
      }
    });
    for (Index c = 0; c < cols; ++c) {
      double total = 0;
      for (Index chunk = 0; chunk < part.chunks(); ++chunk) total += slots[static_cast<std::size_t>(chunk * cols + c)];
      io.out().data[c] = static_cast<S>(total);
    }
  }
  void backward(NodeIo<S>& io) {
    const Array<S> d_x = io.d_in(0);
    const S* d_y = io.d_out().data;
    parallel_for(d_x.total_rows(), rows_grain(d_x.shape.cols), [&](Index begin, Index end) {
      for (Index r = begin; r < end; ++r) {
        for (Index c = 0; c < d_x.shape.cols; ++c) d_x.row(r)[c] += d_y[c];
      }
    });
  }
};

/// y_r = Σ_c x_rc.   d_x_rc = d_y_r.
template <class S>
struct SumColsOp {
  static constexpr const char* kName = "sum_cols";

  void forward(NodeIo<S>& io) {
    const ConstArray<S> x = io.in(0);
    const Array<S> y = io.out();
    parallel_for(x.total_rows(), rows_grain(x.shape.cols), [&](Index begin, Index end) {
      for (Index r = begin; r < end; ++r) *y.row(r) = static_cast<S>(detail::block_sum(x.row(r), x.shape.cols));
    });
  }
  void backward(NodeIo<S>& io) {
    const Array<S> d_x = io.d_in(0);
    const ConstArray<S> d_y = io.d_out();
    parallel_for(d_x.total_rows(), rows_grain(d_x.shape.cols), [&](Index begin, Index end) {
      for (Index r = begin; r < end; ++r) {
        for (Index c = 0; c < d_x.shape.cols; ++c) d_x.row(r)[c] += *d_y.row(r);
      }
    });
  }
};

}  // namespace

template <class S>
Var<S> sum(Var<S> x, Source where) {
  return x.owner().record(SumOp<S>{}, {x}, kScalarShape, where);
}

template <class S>
Var<S> mean(Var<S> x, Source where) {
  const Index count = x.shape().count();
  HSI4D_CHECK(count > 0, "mean of an empty array");
  return x.owner().record(SumOp<S>{1.0 / static_cast<double>(count)}, {x}, kScalarShape, where);
}

template <class S>
Var<S> sum_rows(Var<S> x, Source where) {
  return x.owner().record(SumRowsOp<S>{}, {x}, shape_of(1, x.shape().cols), where);
}

template <class S>
Var<S> sum_cols(Var<S> x, Source where) {
  return x.owner().record(SumColsOp<S>{}, {x}, Shape{x.shape().planes, x.shape().rows, 1, 1}, where);
}

template <class S>
Var<S> norm_cols(Var<S> x, Source where) {
  return sqrt(sum_cols(square(x, where), where), where);
}

#define HSI4D_REDUCE(S)                     \
  template Var<S> sum(Var<S>, Source);      \
  template Var<S> mean(Var<S>, Source);     \
  template Var<S> sum_rows(Var<S>, Source); \
  template Var<S> sum_cols(Var<S>, Source); \
  template Var<S> norm_cols(Var<S>, Source);
HSI4D_REDUCE(float)
HSI4D_REDUCE(double)
#undef HSI4D_REDUCE

}  // namespace hsi4d
