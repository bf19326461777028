// Sparse and dense skinning: the untaped primal, and taped forward + backward, on one thread.
#include <algorithm>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>

#include "bench/goals.h"
#include "body/skinning.h"
#include "core/parallel.h"
#include "core/simd.h"

namespace {

using namespace hsi4d;

/// Deterministic numbers in [−1, 1).
class Numbers {
 public:
  double next() {
    state_ = state_ * 6364136223846793005u + 1442695040888963407u;
    return static_cast<double>(state_ >> 11) * 0x1p-52 - 1;
  }
  Index below(Index n) { return static_cast<Index>((next() + 1) / 2 * static_cast<double>(n)); }

 private:
  std::uint64_t state_ = 1;
};

/// Random joints for each vertex (worst case), or joints that change slowly with the vertex, as in a mesh.
SparseWeights sparse_weights(Index vertices, Index joints, Index per_vertex, bool coherent) {
  Numbers numbers;
  SparseWeights w{vertices, joints, per_vertex, {}, {}};
  for (Index v = 0; v < vertices; ++v) {
    double sum = 0;
    for (Index k = 0; k < per_vertex; ++k) {
      const Index joint = coherent ? (v * joints / vertices + k) % joints : numbers.below(joints);
      w.indices.push_back(static_cast<std::int32_t>(joint));
      w.weights.push_back(1.1 + numbers.next());
      sum += w.weights.back();
    }
    for (Index k = 0; k < per_vertex; ++k) w.weights[static_cast<std::size_t>(v * per_vertex + k)] /= sum;
  }
  return normalized_weights(w, "bench");
}

DenseWeights dense_weights(Index vertices, Index joints) {
  Numbers numbers;
  DenseWeights w{vertices, joints, {}};
  for (Index v = 0; v < vertices; ++v) {
    double sum = 0;
    for (Index j = 0; j < joints; ++j) {
      w.weights.push_back(1.1 + numbers.next());
      sum += w.weights.back();
    }
    for (Index j = 0; j < joints; ++j) w.weights[static_cast<std::size_t>(v * joints + j)] /= sum;
  }
  return normalized_weights(w, "bench");
}

/// Aligned as the arrays of a tape are.
template <class S>
Buffer<S> random_array(Index n) {
  Numbers numbers;
  Buffer<S> a;
  a.resize(n);
  for (S& x : a.span()) x = static_cast<S>(numbers.next());
  return a;
}

/// L = Σ c·y with a constant cotangent c: the least that can stand above skin_points.
template <class S>
struct DotConstant {
  static constexpr const char* kName = "dot_constant";
  static constexpr bool kAssigns = true;
  Buffer<S> cotangent;
  void forward(NodeIo<S>& io) { io.out().scalar() = io.in(0).data[0]; }
  void backward(NodeIo<S>& io) {
    S* d = io.d_in(0).data;
    if (io.must_assign(0)) {
      std::copy_n(cotangent.data(), cotangent.size(), d);
      return;
    }
    on_best_isa([&] {
      for (Index i = 0; i < cotangent.size(); ++i) d[i] += cotangent[i];
    });
  }
};

template <class S>
void primal(benchmark::State& state, const SkinWeights<S>& weights) {
  const auto transforms = random_array<S>(weights.joints() * 12);
  const auto points = random_array<S>(weights.vertices() * 3);
  Buffer<S> result;
  result.resize(points.size());
  with_threads(1, [&] {
    for (auto _ : state) {
      skin_points(weights, transforms.data(), points.data(), result.data());
      benchmark::DoNotOptimize(result.data());
      benchmark::ClobberMemory();
    }
  });
}

template <class S>
void gradient(benchmark::State& state, const SkinWeights<S>& weights, bool wants_points) {
  const auto transforms = random_array<S>(weights.joints() * 12);
  const auto points = random_array<S>(weights.vertices() * 3);
  Tape<S> tape;
  const Var<S> a = tape.parameter("transforms", shape_of(weights.joints(), 12));
  const Var<S> x = tape.parameter("points", shape_of(weights.vertices(), 3));
  if (!wants_points) tape.freeze(x);
  tape.set(x, points.span());
  const Var<S> y = skin_points(weights, a, x);
  const Var<S> loss = tape.record(DotConstant<S>{random_array<S>(points.size())}, {y}, kScalarShape, Source::current());
  with_threads(1, [&] {
    for (auto _ : state) {
      tape.set(a, transforms.span());
      tape.forward(loss);
      tape.backward(loss);
      benchmark::DoNotOptimize(tape.gradient(a).data);
      benchmark::ClobberMemory();
    }
  });
}

/// Multiply-adds of the maths itself, for the share of the processor's peak.
void count_work(benchmark::State& state, double weights_per_vertex, double vertices, double passes) {
  state.counters["fma"] = vertices * (weights_per_vertex * 12 + 9) * passes;
}

template <class S>
void sparse_primal(benchmark::State& state) {
  const SkinWeights<S> weights(sparse_weights(state.range(0), 55, 4, state.range(1) != 0));
  primal(state, weights);
  count_work(state, 4, static_cast<double>(state.range(0)), 1);
}
template <class S>
void sparse_gradient_transforms(benchmark::State& state) {
  const SkinWeights<S> weights(sparse_weights(state.range(0), 55, 4, state.range(1) != 0));
  gradient(state, weights, false);
  count_work(state, 4, static_cast<double>(state.range(0)), 2);
}
template <class S>
void sparse_gradient_both(benchmark::State& state) {
  const SkinWeights<S> weights(sparse_weights(state.range(0), 55, 4, state.range(1) != 0));
  gradient(state, weights, true);
  count_work(state, 4, static_cast<double>(state.range(0)), 2);
}
template <class S>
void dense_primal(benchmark::State& state) {
  const SkinWeights<S> weights(dense_weights(state.range(0), 55));
  primal(state, weights);
  count_work(state, 55, static_cast<double>(state.range(0)), 1);
}
template <class S>
void dense_gradient_both(benchmark::State& state) {
  const SkinWeights<S> weights(dense_weights(state.range(0), 55));
  gradient(state, weights, true);
  count_work(state, 55, static_cast<double>(state.range(0)), 2);
}

#define SPARSE(F)                          \
  BENCHMARK(F<double>)                     \
      ->ArgNames({"vertices", "coherent"}) \
      ->Args({2000, 0})                    \
      ->Args({2000, 1})                    \
      ->Unit(benchmark::kMicrosecond);     \
  BENCHMARK(F<float>)                      \
      ->ArgNames({"vertices", "coherent"}) \
      ->Args({2000, 0})                    \
      ->Args({2000, 1})                    \
      ->Args({10475, 1})                   \
      ->Unit(benchmark::kMicrosecond)
SPARSE(sparse_primal);
SPARSE(sparse_gradient_transforms);
SPARSE(sparse_gradient_both);
#undef SPARSE
#define DENSE(F)                                                                       \
  BENCHMARK(F<float>)->ArgName("vertices")->Arg(10475)->Unit(benchmark::kMicrosecond); \
  BENCHMARK(F<double>)->ArgName("vertices")->Arg(10475)->Unit(benchmark::kMicrosecond)
DENSE(dense_primal);
DENSE(dense_gradient_both);
#undef DENSE

const bench::AtStart goals([] {
  using bench::ask_ratio, bench::ask_time;
  const std::string size = "/vertices:2000/coherent:";
  for (const auto& [joints, what] : {std::pair("0", "random joints"), std::pair("1", "joints as on a mesh")}) {
    ask_ratio("sparse skinning, V=2000 K=4 double, gradient / primal, " + std::string(what),
              "sparse_gradient_transforms<double>" + size + joints, "sparse_primal<double>" + size + joints, 2.5);
  }
  ask_time("dense skinning, V=10475 J=55 float, forward + backward", "dense_gradient_both<float>/vertices:10475",
           0.68e6);
});

}  // namespace
