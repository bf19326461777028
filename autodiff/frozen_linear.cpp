#include "autodiff/frozen_linear.h"

#include <algorithm>

#include "core/parallel.h"
#include "core/simd.h"

namespace hsi4d {

namespace {

/// Rows that are multiplied together, so that a row of the matrix is fetched once for all of them.
constexpr Index kRowsTogether = 4;
/// Rows of one parallel chunk; a multiple of kRowsTogether.
constexpr Index kRowGrain = 8;

/// y_r += Σ_i x_r,i m_i for `Rows` rows; m [n_in,n_out].
template <Index Rows, class S>
void add_products(const S* const* x, Index n_in, const S* m, Index n_out, S* const* y) {
  for (Index i = 0; i < n_in; ++i) {
    const S* row = m + i * n_out;
    for (Index r = 0; r < Rows; ++r) {
      const S by = x[r][i];
      S* to = y[r];
#pragma GCC ivdep
      for (Index o = 0; o < n_out; ++o) to[o] += by * row[o];
    }
  }
}

/// y += x m, row by row.
template <class S>
void add_rows(const ConstArray<S>& x, const std::vector<S>& m, const Array<S>& y, Index begin, Index end) {
  on_best_isa([&] {
    const Index n_in = x.shape.cols, n_out = y.shape.cols;
    Index r = begin;
    for (; r + kRowsTogether <= end; r += kRowsTogether) {
      const S* const from[kRowsTogether] = {x.row(r), x.row(r + 1), x.row(r + 2), x.row(r + 3)};
      S* const to[kRowsTogether] = {y.row(r), y.row(r + 1), y.row(r + 2), y.row(r + 3)};
      add_products<kRowsTogether>(from, n_in, m.data(), n_out, to);
    }
    for (; r < end; ++r) {
      const S* const from[1] = {x.row(r)};
      S* const to[1] = {y.row(r)};
      add_products<1>(from, n_in, m.data(), n_out, to);
    }
  });
}

template <class S>
struct FrozenLinearOp {
  static constexpr const char* kName = "frozen_linear";
  FrozenLinear<S> map;

  void forward(NodeIo<S>& io) {
    const ConstArray<S> x = io.in(0);
    const Array<S> y = io.out();
    parallel_for(x.shape.rows, kRowGrain, [&](Index begin, Index end) {
      for (Index r = begin; r < end; ++r) std::copy_n(map.tables().bias.data(), y.shape.cols, y.row(r));
      add_rows(x, map.tables().by_input, y, begin, end);
    });
  }

  void backward(NodeIo<S>& io) {
    const ConstArray<S> d_y = io.d_out();
    const Array<S> d_x = io.d_in(0);
    parallel_for(d_x.shape.rows, kRowGrain,
                 [&](Index begin, Index end) { add_rows(d_y, map.tables().by_output, d_x, begin, end); });
  }
};

}  // namespace

template <class S>
FrozenLinear<S>::FrozenLinear(std::span<const double> weight, std::span<const double> bias)
    : outputs_(static_cast<Index>(bias.size())) {
  HSI4D_CHECK(!bias.empty(), "a map without outputs");
  HSI4D_CHECK_EQ(weight.size() % bias.size(), std::size_t{0});
  inputs_ = static_cast<Index>(weight.size() / bias.size());
  auto tables = std::make_shared<Tables>();
  tables->by_output.assign(weight.begin(), weight.end());
  tables->by_input.resize(weight.size());
  for (Index o = 0; o < outputs_; ++o) {
    for (Index i = 0; i < inputs_; ++i) {
      tables->by_input[static_cast<std::size_t>(i * outputs_ + o)] =
          tables->by_output[static_cast<std::size_t>(o * inputs_ + i)];
    }
  }
  tables->bias.assign(bias.begin(), bias.end());
  tables_ = std::move(tables);
}

template <class S>
Var<S> frozen_linear(const FrozenLinear<S>& map, Var<S> x, Source where) {
  const Index rows = x.shape().rows;
  HSI4D_CHECK_EQ(x.shape(), shape_of(rows, map.inputs()));
  return x.owner().record(FrozenLinearOp<S>{map}, {x}, shape_of(rows, map.outputs()), where);
}

#define HSI4D_INSTANTIATE(S)      \
  template class FrozenLinear<S>; \
  template Var<S> frozen_linear(const FrozenLinear<S>&, Var<S>, Source);
HSI4D_INSTANTIATE(float)
HSI4D_INSTANTIATE(double)
#undef HSI4D_INSTANTIATE

}  // namespace hsi4d
