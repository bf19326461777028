// Costs of the tape itself: a node, a lambda loss, anomaly mode.
#include <cmath>
#include <memory>
#include <vector>

#include <benchmark/benchmark.h>

#include "autodiff/elementwise.h"
#include "autodiff/map.h"
#include "autodiff/reduce.h"
#include "bench/goals.h"
#include "core/parallel.h"

namespace hsi4d::bench {
namespace {

constexpr int kNodes = 1000;

/// The cheapest operator there can be, so that what is measured is the tape.
struct CopyOp {
  static constexpr const char* kName = "copy";
  void forward(NodeIo<float>& io) { io.out().scalar() = io.in(0).scalar(); }
  void backward(NodeIo<float>& io) { io.d_in(0).scalar() += io.d_out().scalar(); }
};

template <class AddNode>
void chain_of_nodes(benchmark::State& state, const AddNode& add_node) {
  Tape<float> tape;
  const auto x = tape.parameter("x", kScalarShape);
  auto y = x;
  for (int i = 0; i < kNodes; ++i) y = add_node(tape, y);
  float value = 0;
  for (auto _ : state) {
    tape.write(x).scalar() = value += 1;
    tape.forward(y);
    tape.backward(y);
    benchmark::DoNotOptimize(tape.gradient(x).data);
  }
}

void node_overhead(benchmark::State& state) {
  chain_of_nodes(state, [](Tape<float>& tape, Var<float> y) {
    return tape.record(CopyOp{}, {y}, kScalarShape, Source::current());
  });
}
BENCHMARK(node_overhead)->Name("tape/1000_nodes");

void scalar_operator(benchmark::State& state) {
  chain_of_nodes(state, [](Tape<float>&, Var<float> y) { return y + 1.0; });
}
BENCHMARK(scalar_operator)->Name("tape/1000_scalar_additions");

// Lambda losses of the kind that users write. Four inputs: Welsch's robust residual with its own scale and weight. Ten:
// the robust distance of a point to the plane through another point with a normal, weighted.
const auto kLossOfFour = [](auto a, auto b, auto scale, auto weight) {
  return weight * (1.0f - exp(square((a - b) / scale) * -0.5f));
};
const auto kLossOfTen = [](auto px, auto py, auto pz, auto qx, auto qy, auto qz, auto nx, auto ny, auto nz,
                           auto weight) {
  const auto distance = ((px - qx) * nx + (py - qy) * ny + (pz - qz) * nz) / sqrt(nx * nx + ny * ny + nz * nz);
  return weight * (1.0f - exp(square(distance) * -0.5f));
};

constexpr Index kElements =
    2048;  // as many as a body has joints, contacts or vertices; images are bound by memory instead

template <std::size_t K>
std::vector<std::vector<float>> lambda_inputs() {
  std::vector<std::vector<float>> all(K, std::vector<float>(kElements));
  for (std::size_t k = 0; k < K; ++k) {
    for (std::size_t i = 0; i < kElements; ++i) {
      all[k][i] = 1.5f + static_cast<float>(std::sin(0.37 * static_cast<double>(i) + static_cast<double>(k)));
    }
  }
  return all;
}

/// The fastest plain loop over the same lambda: sixteen running double sums, the best instruction set.
template <std::size_t K, class F>
void lambda_primal(benchmark::State& state, const F& f) {
  const auto inputs = lambda_inputs<K>();
  std::array<const float*, K> x;
  for (std::size_t k = 0; k < K; ++k) x[k] = inputs[k].data();
  const auto loop = [&]<std::size_t... k>(std::index_sequence<k...>) {
    double sums[16] = {};
    for (Index i = 0; i < kElements; i += 16) {
      for (Index lane = 0; lane < 16; ++lane) sums[lane] += static_cast<double>(f(x[k][i + lane]...));
    }
    double total = 0;
    for (const double s : sums) total += s;
    return total;
  };
  for (auto _ : state) {
    double total = 0;
    on_best_isa([&] { total = loop(std::make_index_sequence<K>()); });
    benchmark::DoNotOptimize(total);
  }
}

template <std::size_t K, class F>
void lambda_gradient(benchmark::State& state, const F& f) {
  const auto inputs = lambda_inputs<K>();
  Tape<float> tape;
  Var<float> x[K];
  for (std::size_t k = 0; k < K; ++k) {
    x[k] = tape.parameter("x", shape_of(kElements, 1));
    tape.set(x[k], inputs[k]);
  }
  const auto loss = sum_over(x, f);
  for (auto _ : state) {
    tape.write(x[0]);
    tape.forward(loss);
    tape.backward(loss);
    benchmark::DoNotOptimize(tape.gradient(x[K - 1]).data);
  }
}

void lambda_4_primal(benchmark::State& state) { lambda_primal<4>(state, kLossOfFour); }
void lambda_4_gradient(benchmark::State& state) { lambda_gradient<4>(state, kLossOfFour); }
void lambda_10_primal(benchmark::State& state) { lambda_primal<10>(state, kLossOfTen); }
void lambda_10_gradient(benchmark::State& state) { lambda_gradient<10>(state, kLossOfTen); }
BENCHMARK(lambda_4_primal)->Name("lambda/4_inputs/primal");
BENCHMARK(lambda_4_gradient)->Name("lambda/4_inputs/gradient");
BENCHMARK(lambda_10_primal)->Name("lambda/10_inputs/primal");
BENCHMARK(lambda_10_gradient)->Name("lambda/10_inputs/gradient");

const AtStart goals([] {
  ask_time("node overhead, forward + backward", "tape/1000_nodes", 100, kNodes);
  ask_ratio("lambda loss of 4 inputs: value and gradient / value alone", "lambda/4_inputs/gradient",
            "lambda/4_inputs/primal", 2);
  ask_ratio("lambda loss of 10 inputs: value and gradient / value alone", "lambda/10_inputs/gradient",
            "lambda/10_inputs/primal", 3);
});

}  // namespace
}  // namespace hsi4d::bench
