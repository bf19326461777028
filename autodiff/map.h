// Elementwise functions and sums of them, from a lambda: no adjoint is written by hand.
//
//   map({a, b}, [](auto x, auto y) { return x * exp(-y); })            an array of the (broadcast) shape
//   sum_over({a, b}, [](auto x, auto y) { return square(x - y); })     one number
//
// The lambda is evaluated on plain numbers for the value and on dual numbers for the derivatives, block by block in
// vector code. It must be a pure function of its arguments, written with the mathematics of dual.h.
#pragma once

#include "autodiff/adjoint_run.h"
#include "autodiff/block_sum.h"
#include "autodiff/blocks.h"
#include "autodiff/curvature_weights.h"
#include "autodiff/dual.h"
#include "autodiff/tape.h"
#include "core/simd.h"

namespace hsi4d {

namespace detail {

/// Makes an elementwise function of a lambda: the value as it is, the partial derivatives by dual numbers.
template <class F>
struct ByDualNumbers {
  static constexpr const char* kName = "map";
  F f;

  template <class... T>
  auto value(T... x) const {
    return f(x...);
  }
  /// Value, and d value / d x_k into partial[k].
  template <class S, class... T>
  S partials(S* partial, T... x) const {
    return from_dual(
        partial,
        [&]<std::size_t... k>(std::index_sequence<k...>) {
          return f(dual_variable<k>(x)...);
        }(std::index_sequence_for<T...>()),
        std::index_sequence_for<T...>());
  }

 private:
  template <class S, unsigned Mask, std::size_t... k>
  static S from_dual(S* partial, const Dual<S, Mask>& y, std::index_sequence<k...>) {
    ((partial[k] = partial_or_zero<k>(y)), ...);
    return y.value;
  }
  /// A lambda may return a number that depends on no input.
  template <class S, std::size_t... k>
  static S from_dual(S* partial, std::type_identity_t<S> y, std::index_sequence<k...>) {
    ((partial[k] = S(0)), ...);
    return y;
  }
  template <std::size_t k, class S, unsigned Mask>
  static S partial_or_zero(const Dual<S, Mask>& y) {
    if constexpr (Dual<S, Mask>::depends_on(k)) {
      return y.partial(k);
    } else {
      return S(0);
    }
  }
};

/// Calls g(x[0][i], …, x[K−1][i]).
template <class G, class S, std::size_t K, std::size_t... k>
auto call_at(const G& g, const std::array<const S*, K>& x, Index i, std::index_sequence<k...>) {
  return g(x[k][i]...);
}

/// Where the partial derivatives of a block go or come from: a run of numbers for each operand.
template <class S, std::size_t K>
using PartialRuns = std::array<S*, K>;

/// Room for them.
template <class S, std::size_t K>
struct PartialRoom {
  alignas(kAlignment) S numbers[K][kBlock];
  PartialRuns<S, K> runs() {
    PartialRuns<S, K> all;
    for (std::size_t k = 0; k < K; ++k) all[k] = numbers[k];
    return all;
  }
};

/// Values of a block.
template <class S, std::size_t K, class F>
void block_values(const F& f, const Block<S, K>& block, S* y) {
  const auto x = block.x;
  const auto value = [&f](auto... arguments) { return f.value(arguments...); };
  for (Index i = 0; i < block.n; ++i) y[i] = static_cast<S>(call_at(value, x, i, std::make_index_sequence<K>()));
}

/// Values of a block, and its partial derivatives.
template <class S, std::size_t K, class F>
void block_partials(const F& f, const Block<S, K>& block, S* y, const PartialRuns<S, K>& partial) {
  const auto x = block.x;
  const auto runs = partial;
  // The runs overlap no operand; without saying so the compiler gives up comparing 2K + 1 pointers.
#pragma GCC ivdep
  for (Index i = 0; i < block.n; ++i) {
    S p[K];
    y[i] = call_at([&](auto... arguments) { return f.template partials<S>(p, arguments...); }, x, i,
                   std::make_index_sequence<K>());
    for (std::size_t k = 0; k < K; ++k) runs[k][i] = p[k];
  }
}

/// Adds blocks of partial derivatives to the adjoints of K operands, in parallel, the same bits for any thread count.
/// An operand that several chunks share gets one double slot a chunk, summed in order at the end.
template <class S, std::size_t K>
class AdjointSink {
 public:
  AdjointSink(NodeIo<S>& io, const BlockWalk<S, K>& walk, Index chunks) : walk_(walk), chunks_(chunks) {
    for (std::size_t k = 0; k < K; ++k) {
      wants_[k] = io.wants(static_cast<int>(k));
      if (!wants_[k]) continue;
      d_in_[k] = io.d_in(static_cast<int>(k));
      assigns_[k] = io.must_assign(static_cast<int>(k));
      // An operand that a unit meets more than once is added to, from zero.
      if (assigns_[k] && walk.broadcast(k) && !walk.shared_by_units(k)) {
        std::fill_n(d_in_[k].data, d_in_[k].shape.memory(), S(0));
        assigns_[k] = false;
      }
      if (!walk.shared_by_units(k)) continue;
      slots_[k] = io.template scratch<double>(chunks * d_in_[k].shape.memory()).data();
      std::fill_n(slots_[k], chunks * d_in_[k].shape.memory(), 0.0);
    }
  }
  bool wants(std::size_t k) const { return wants_[k]; }

  /// d_x_k += partial_k · weight over a block.
  void add(Index chunk, const Block<S, K>& block, const PartialRuns<S, K>& partial, const Weights<S>& weights) const {
    for (std::size_t k = 0; k < K; ++k) {
      if (!wants_[k]) continue;
      AdjointRun<S> run{d_in_[k].data + block.in[k], nullptr, assigns_[k], walk_.column_step(k) == 0};
      if (slots_[k] != nullptr) run.slot = slots_[k] + chunk * d_in_[k].shape.memory() + block.in[k];
      add_weighted(run, partial[k], weights, block.n);
    }
  }

  void finish() const {
    for (std::size_t k = 0; k < K; ++k) {
      if (!wants_[k] || slots_[k] == nullptr) continue;
      const Index size = d_in_[k].shape.memory();
      for (Index i = 0; i < size; ++i) {
        double sum = 0;
        for (Index chunk = 0; chunk < chunks_; ++chunk) sum += slots_[k][chunk * size + i];
        d_in_[k].data[i] = static_cast<S>(sum) + (assigns_[k] ? S(0) : d_in_[k].data[i]);
      }
    }
  }

 private:
  const BlockWalk<S, K>& walk_;
  Index chunks_;
  std::array<bool, K> wants_{}, assigns_{};
  std::array<Array<S>, K> d_in_{};
  std::array<double*, K> slots_{};
};

template <class S, std::size_t K>
BlockWalk<S, K> walk_inputs(const NodeIo<S>& io, const Shape& out) {
  std::array<ConstArray<S>, K> in;
  for (std::size_t k = 0; k < K; ++k) in[k] = io.in(static_cast<int>(k));
  return BlockWalk<S, K>(out, in);
}

template <class S, std::size_t K>
Shape broadcast_all(const Var<S>* inputs) {
  Shape shape = inputs[0].shape();
  for (std::size_t k = 1; k < K; ++k) shape = broadcast_shape(shape, inputs[k].shape());
  return shape;
}

}  // namespace detail

/// y = f(x_1, …, x_K) elementwise. F has `value(x...)` and `partials<S>(S* partial, x...)`; a function of one argument
/// whose second derivative is a number ≥ 0 tells it as kCurvature.
template <class S, std::size_t K, class F>
struct MapOp {
  static constexpr const char* kName = F::kName;
  static constexpr bool kAssigns = true;
  F f;

  void forward(NodeIo<S>& io) {
    const Array<S> y = io.out();
    const auto walk = detail::walk_inputs<S, K>(io, y.shape);
    const Partition part = walk.partition();
    parallel_for(part.n, part.grain, [&](Index begin, Index end) {
      on_best_isa_for<S>([&] {
        walk.run(begin, end, [&](const Block<S, K>& block) {
          alignas(kAlignment) S values[kBlock];
          detail::block_values(f, block, values);
          std::copy_n(values, block.n, y.data + block.out);
        });
      });
    });
  }

  void backward(NodeIo<S>& io) {
    const ConstArray<S> d_y = io.d_out();
    const auto walk = detail::walk_inputs<S, K>(io, d_y.shape);
    const Partition all = walk.partition();
    const Partition part = reduction_partition(all.n, all.grain);
    const detail::AdjointSink<S, K> sink(io, walk, part.chunks());
    parallel_chunks(part, [&](Index chunk, Index begin, Index end) {
      on_best_isa_for<S>([&] {
        walk.run(begin, end, [&](const Block<S, K>& block) {
          alignas(kAlignment) S values[kBlock];
          detail::PartialRoom<S, K> room;
          const S* d = d_y.data + block.out;
          detail::block_partials(f, block, values, room.runs());
          sink.add(chunk, block, room.runs(), {d, 0});
        });
      });
    });
    sink.finish();
  }

  /// w_x += f'' d_y, of squares.
  bool weigh(NodeIo<S>& io, CurvatureWeights<S>& weights) requires(K == 1 && requires { F::kCurvature; }) {
    const ConstArray<S> d_y = io.d_out();
    const Array<S> to = weights.of_input(io, 0);
    for (Index r = 0; r < to.total_rows(); ++r) {
      for (Index c = 0; c < to.shape.cols; ++c) to.row(r)[c] += F::kCurvature * std::max(d_y.row(r)[c], S(0));
    }
    return true;
  }
};

/// Σ f(x_1, …, x_K) over all elements, in double. When a gradient is wanted the forward run evaluates the partial
/// derivatives with the values and keeps them, so that the lambda is evaluated once an iteration.
template <class S, std::size_t K, class F>
struct SumOverOp {
  static constexpr const char* kName = "sum_over";
  static constexpr bool kAssigns = true;
  F f;
  Shape shape;           // of the broadcast inputs
  Buffer<S> saved = {};  // partial derivatives: for each block in the order of the walk, K runs of its numbers

  Index saved_bytes() const { return saved.capacity_bytes(); }

  void forward(NodeIo<S>& io) {
    const auto walk = detail::walk_inputs<S, K>(io, shape);
    bool gradient = false;
    for (std::size_t k = 0; k < K; ++k) gradient = gradient || io.wants(static_cast<int>(k));
    if (gradient) saved.resize(shape.count() * static_cast<Index>(K));
    const Partition all = walk.partition();
    io.out().scalar() = static_cast<S>(parallel_sum(all.n, all.grain, [&](Index begin, Index end) {
      return gradient ? sum_and_save(walk, begin, end) : sum_only(walk, begin, end);
    }));
  }

  void backward(NodeIo<S>& io) {
    const S d_sum = io.d_out().scalar();
    const auto walk = detail::walk_inputs<S, K>(io, shape);
    const Partition all = walk.partition();
    const Partition part = reduction_partition(all.n, all.grain);
    const detail::AdjointSink<S, K> sink(io, walk, part.chunks());
    parallel_chunks(part, [&](Index chunk, Index begin, Index end) {
      on_best_isa_for<S>([&] {
        S* kept = saved_of(walk, begin);
        walk.run(begin, end, [&](const Block<S, K>& block) {
          sink.add(chunk, block, next_runs(kept, block.n), {nullptr, d_sum});
        });
      });
    });
    sink.finish();
  }

  /// w_x += d_sum f'²/(2 f), which is the curvature of f = r² by a linear r: of squares. Where only one operand moves,
  /// and is not broadcast.
  bool weigh(NodeIo<S>& io, CurvatureWeights<S>& weights) {
    const auto walk = detail::walk_inputs<S, K>(io, shape);
    const S d_sum = io.d_out().scalar();
    std::size_t moving = K;
    for (std::size_t k = 0; k < K; ++k) {
      if (!io.wants(static_cast<int>(k))) continue;
      if (moving != K || walk.broadcast(k)) return true;
      moving = k;
    }
    if (moving == K || !(d_sum > S(0))) return true;
    const Array<S> to = weights.of_input(io, static_cast<int>(moving));
    S* kept = saved.data();
    walk.run(0, walk.partition().n, [&](const Block<S, K>& block) {
      alignas(kAlignment) S values[kBlock];
      detail::block_values(f, block, values);
      const S* const slope = next_runs(kept, block.n)[moving];
      for (Index i = 0; i < block.n; ++i) {
        if (values[i] > S(0)) to.data[block.in[moving] + i] += d_sum * slope[i] * slope[i] / (2 * values[i]);
      }
    });
    return true;
  }

 private:
  S* saved_of(const BlockWalk<S, K>& walk, Index unit) {
    return saved.data() + unit * walk.numbers_per_unit() * static_cast<Index>(K);
  }

  /// The next block's runs in the saved numbers; advances `at` past them.
  static detail::PartialRuns<S, K> next_runs(S*& at, Index n) {
    detail::PartialRuns<S, K> runs;
    for (std::size_t k = 0; k < K; ++k, at += n) runs[k] = at;
    return runs;
  }

  double sum_only(const BlockWalk<S, K>& walk, Index begin, Index end) const {
    double sum = 0;
    on_best_isa_for<S>([&] {
      walk.run(begin, end, [&](const Block<S, K>& block) {
        alignas(kAlignment) S values[kBlock];
        detail::block_values(f, block, values);
        sum += detail::block_sum(values, block.n);
      });
    });
    return sum;
  }

  double sum_and_save(const BlockWalk<S, K>& walk, Index begin, Index end) {
    double sum = 0;
    on_best_isa_for<S>([&] {
      S* keep = saved_of(walk, begin);
      walk.run(begin, end, [&](const Block<S, K>& block) {
        alignas(kAlignment) S values[kBlock];
        detail::block_partials(f, block, values, next_runs(keep, block.n));
        sum += detail::block_sum(values, block.n);
      });
    });
    return sum;
  }
};

/// y = f(x_1, …, x_K) elementwise, with broadcasting; f is a pure function written with the mathematics of dual.h.
///
/// @param inputs  arrays whose planes, rows and columns are each equal or 1
/// @return        array of the common shape, with the padding of the first input of that shape
/// Adjoint: every input, by dual numbers; where f branches, of the branch taken.
/// Throws InternalError naming both shapes when they do not fit.
template <class S, std::size_t K, class F>
Var<S> map(const Var<S> (&inputs)[K], F f, Source where = Source::current()) {
  using Function = detail::ByDualNumbers<F>;
  return inputs[0].owner().record(MapOp<S, K, Function>{Function{f}}, std::span<const Var<S>>(inputs),
                                  std::array{detail::broadcast_all<S, K>(inputs)}, where);
}

/// Σ f(x_1, …, x_K) over all elements of the broadcast inputs: a scalar, summed in double in a fixed order.
/// Arguments, adjoint and errors as `map`.
template <class S, std::size_t K, class F>
Var<S> sum_over(const Var<S> (&inputs)[K], F f, Source where = Source::current()) {
  using Function = detail::ByDualNumbers<F>;
  return inputs[0].owner().record(SumOverOp<S, K, Function>{Function{f}, detail::broadcast_all<S, K>(inputs)},
                                  std::span<const Var<S>>(inputs), std::array{kScalarShape}, where);
}

}  // namespace hsi4d
