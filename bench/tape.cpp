#include "bench/tape.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

#include "autodiff/elementwise.h"
#include "autodiff/map.h"
#include "autodiff/reduce.h"
#include "bench/tape_operators.h"
#include "core/check.h"
#include "core/parallel.h"
#include "core/simd.h"
#include "core/stopwatch.h"
#include "core/suggest.h"
#include "core/text.h"

namespace hsi4d {

namespace {

// --- chains of nodes -------------------------------------------------------------------------------------------------

constexpr Index kNodes = 1000;

/// The cheapest operator there can be, so that what is measured is the tape.
struct CopyOp {
  static constexpr const char* kName = "copy";
  void forward(NodeIo<float>& io) { io.out().scalar() = io.in(0).scalar(); }
  void backward(NodeIo<float>& io) { io.d_in(0).scalar() += io.d_out().scalar(); }
};

/// Runs a chain forward and backward. @param add_node  adds one to the chain
template <class AddNode>
std::function<void()> chain_of_nodes(const AddNode& add_node) {
  const auto tape = std::make_shared<Tape<float>>();
  const Var<float> x = tape->parameter("x", kScalarShape);
  Var<float> y = x;
  for (Index i = 0; i < kNodes; ++i) y = add_node(*tape, y);
  return [tape, x, y] {
    tape->write(x).scalar() += 1;
    tape->forward(y);
    tape->backward(y);
  };
}

// --- lambda losses of the kind that users write ----------------------------------------------------------------------

/// Welsch's robust residual with its own scale and weight.
const auto kLossOfFour = [](auto a, auto b, auto scale, auto weight) {
  return weight * (1.0f - exp(square((a - b) / scale) * -0.5f));
};
/// The robust distance of a point to the plane through another point with a normal, weighted.
const auto kLossOfTen = [](auto px, auto py, auto pz, auto qx, auto qy, auto qz, auto nx, auto ny, auto nz,
                           auto weight) {
  const auto distance = ((px - qx) * nx + (py - qy) * ny + (pz - qz) * nz) / sqrt(nx * nx + ny * ny + nz * nz);
  return weight * (1.0f - exp(square(distance) * -0.5f));
};

/// As many as a body has joints, contacts or vertices; images are bound by memory instead.
constexpr Index kElements = 2048;

template <std::size_t K>
using LambdaInputs = std::array<std::vector<float>, K>;

template <std::size_t K>
LambdaInputs<K> lambda_inputs() {
  LambdaInputs<K> all;
  for (std::size_t k = 0; k < K; ++k) {
    for (Index i = 0; i < kElements; ++i) {
      all[k].push_back(1.5f + static_cast<float>(std::sin(0.37 * static_cast<double>(i) + static_cast<double>(k))));
    }
  }
  return all;
}

/// The fastest plain loop over the same lambda: sixteen running double sums, the best instruction set.
template <std::size_t K, class F>
std::function<void()> lambda_primal(const F& f) {
  const auto inputs = std::make_shared<const LambdaInputs<K>>(lambda_inputs<K>());
  const auto result = std::make_shared<double>(0);
  return [inputs, result, f] {
    std::array<const float*, K> x;
    for (std::size_t k = 0; k < K; ++k) x[k] = (*inputs)[k].data();
    const auto loop = [&]<std::size_t... k>(std::index_sequence<k...>) {
      double sums[16] = {};
      for (Index i = 0; i < kElements; i += 16) {
        for (Index lane = 0; lane < 16; ++lane) sums[lane] += static_cast<double>(f(x[k][i + lane]...));
      }
      double total = 0;
      for (const double s : sums) total += s;
      return total;
    };
    on_best_isa([&] { *result = loop(std::make_index_sequence<K>()); });
  };
}

template <std::size_t K, class F>
std::function<void()> lambda_gradient(const F& f) {
  const LambdaInputs<K> inputs = lambda_inputs<K>();
  const auto tape = std::make_shared<Tape<float>>();
  Var<float> x[K];
  for (std::size_t k = 0; k < K; ++k) {
    x[k] = tape->parameter("x", shape_of(kElements, 1));
    tape->set(x[k], inputs[k]);
  }
  return [tape, first = x[0], loss = sum_over(x, f)] {
    tape->write(first);
    tape->forward(loss);
    tape->backward(loss);
  };
}

// --- the workloads ---------------------------------------------------------------------------------------------------

template <std::size_t K, class F>
void add_loss(const std::string& workload, const F& f, double goal, std::vector<TapeWork>& work) {
  const std::string name = "tape/" + workload + "/";
  work.push_back({.name = name + "primal", .elements = kElements, .run = lambda_primal<K>(f)});
  work.push_back({.name = name + "gradient",
                  .elements = kElements,
                  .against = name + "primal",
                  .goal = goal,
                  .run = lambda_gradient<K>(f)});
}

struct TapeWorkload {
  const char* name;
  void (*add)(std::vector<TapeWork>& work);
};

/// Goals: design.md's tape: 100 ns a node, twice the value for four inputs, three times for ten.
constexpr std::array<TapeWorkload, 7> kWorkloads = {{
    {"nodes",
     [](std::vector<TapeWork>& work) {
       const auto add_copy = [](Tape<float>& tape, Var<float> y) {
         return tape.record(CopyOp{}, {y}, kScalarShape, Source::current());
       };
       work.push_back({.name = "tape/nodes/both", .nodes = kNodes, .goal = 100, .run = chain_of_nodes(add_copy)});
     }},
    {"additions",
     [](std::vector<TapeWork>& work) {
       const auto add_one = [](Tape<float>&, Var<float> y) { return y + 1.0; };
       work.push_back({.name = "tape/additions/both", .nodes = kNodes, .run = chain_of_nodes(add_one)});
     }},
    {"loss_of_4", [](std::vector<TapeWork>& work) { add_loss<4>("loss_of_4", kLossOfFour, 2, work); }},
    {"loss_of_10", [](std::vector<TapeWork>& work) { add_loss<10>("loss_of_10", kLossOfTen, 3, work); }},
    {"ssim", detail::add_ssim},
    {"skinning", detail::add_skinning},
    {"anomaly", detail::add_anomaly},
}};

// --- timing ----------------------------------------------------------------------------------------------------------

constexpr double kRoundSeconds = 5e-3;  // of a work, long against the clock's and the caches' start

/// Mean seconds of a run, of so many.
double mean_seconds(const TapeWork& work, Index runs) {
  Stopwatch watch;
  for (Index i = 0; i < runs; ++i) work.run();
  return watch.lap() / static_cast<double>(runs);
}

/// Runs that take about kRoundSeconds, after some to warm up.
Index runs_of_a_round(const TapeWork& work) {
  Index runs = 1;
  while (mean_seconds(work, runs) * static_cast<double>(runs) < kRoundSeconds) runs *= 2;
  return runs;
}

TapeMeasurement measured(const TapeWork& work, std::vector<double> seconds) {
  std::sort(seconds.begin(), seconds.end());
  TapeMeasurement m;
  m.name = work.name;
  m.median_ms = 1e3 * seconds[seconds.size() / 2];
  m.min_ms = 1e3 * seconds.front();
  m.repeats = static_cast<int>(seconds.size());
  m.nodes = work.nodes;
  m.elements = work.elements;
  m.against = work.against;
  m.goal = work.goal;
  return m;
}

}  // namespace

std::vector<std::string> tape_workloads() {
  std::vector<std::string> names;
  for (const TapeWorkload& workload : kWorkloads) names.emplace_back(workload.name);
  return names;
}

std::vector<TapeWork> tape_work(const std::vector<std::string>& workloads) {
  const std::vector<std::string> all = tape_workloads();
  for (const std::string& name : workloads) {
    if (std::find(all.begin(), all.end(), name) == all.end())
      throw UserError("hsi4d bench tape: no workload \"" + name + "\"; known: " + joined(all) +
                      did_you_mean(name, all));
  }
  std::vector<TapeWork> work;
  for (const TapeWorkload& workload : kWorkloads) {
    if (workloads.empty() || std::find(workloads.begin(), workloads.end(), workload.name) != workloads.end())
      workload.add(work);
  }
  return work;
}

double TapeMeasurement::ns_each() const { return 1e6 * median_ms / static_cast<double>(std::max(nodes, elements)); }

std::vector<TapeMeasurement> bench_tape(const TapeBench& options) {
  const std::vector<TapeWork> work = tape_work(options.workloads);
  std::vector<std::vector<double>> seconds(work.size());
  with_threads(1, [&] {
    std::vector<Index> runs;
    for (const TapeWork& w : work) runs.push_back(runs_of_a_round(w));
    for (int round = 0; round < options.repeats; ++round) {
      for (std::size_t k = 0; k < work.size(); ++k) seconds[k].push_back(mean_seconds(work[k], runs[k]));
    }
  });
  std::vector<TapeMeasurement> all;
  for (std::size_t k = 0; k < work.size(); ++k) all.push_back(measured(work[k], std::move(seconds[k])));
  for (TapeMeasurement& m : all) {
    const auto base = std::find_if(all.begin(), all.end(), [&m](const auto& other) { return other.name == m.against; });
    if (base != all.end() && base->median_ms > 0) m.ratio = m.median_ms / base->median_ms;
  }
  return all;
}

}  // namespace hsi4d
