// `hsi4d bench tape`: what the tape itself costs: a node, and the gradient of a lambda loss over its value alone.
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <memory>
#include <optional>

#include <nlohmann/json.hpp>

#include "autodiff/elementwise.h"
#include "autodiff/map.h"
#include "autodiff/reduce.h"
#include "bench/list.h"
#include "bench/tape_operators.h"
#include "bench/timing.h"
#include "core/formatted.h"
#include "core/parallel.h"
#include "core/simd.h"
#include "core/stopwatch.h"
#include "core/table.h"

namespace hsi4d::cli {

namespace {

/// The time of one run of a work.
struct TapeMeasurement : BenchTime {
  Index nodes = 0, elements = 0;     ///< as the work's
  std::optional<double> ratio = {};  ///< of medians, over `against`
  std::string against = {};
  std::optional<double> goal = {};  ///< as the work's

  /// Nanoseconds a node of a chain, or an element of a loss, by the median.
  double ns_each() const { return 1e6 * median_ms / static_cast<double>(std::max(nodes, elements)); }
};

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

/// What they measure, on one thread:
///
///   nodes, additions     1000 scalar operators in a row, forward and backward (`both`): a bare copy, and x + 1
///   loss_of_4            `primal`: 2048 values of a robust residual with its own scale and weight, summed by the
///                        fastest plain loop; `gradient`: sum_over of the same lambda, value and gradient of all inputs
///   loss_of_10           the same of a robust distance of a point to a plane
///   ssim, skinning, anomaly   operators with goals of their own (bench/tape_operators.h)
///
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

TapeMeasurement measured(const TapeWork& work, const std::vector<double>& seconds) {
  TapeMeasurement m{bench_time(work.name, 1, seconds)};
  m.nodes = work.nodes;
  m.elements = work.elements;
  m.against = work.against;
  m.goal = work.goal;
  return m;
}

/// Measures every work, in rounds, so that noise meets all alike.
std::vector<TapeMeasurement> bench_tape(const BenchOptions& options) {
  std::vector<TapeWork> work;
  for (const TapeWorkload& workload : chosen_workloads("tape", options.workloads, kWorkloads)) workload.add(work);
  std::vector<std::vector<double>> seconds(work.size());
  with_threads(1, [&] {
    std::vector<Index> runs;
    for (const TapeWork& w : work) runs.push_back(runs_of_a_round(w));
    for (int round = 0; round < options.repeats; ++round) {
      for (std::size_t k = 0; k < work.size(); ++k) seconds[k].push_back(mean_seconds(work[k], runs[k]));
    }
  });
  std::vector<TapeMeasurement> all;
  for (std::size_t k = 0; k < work.size(); ++k) all.push_back(measured(work[k], seconds[k]));
  for (TapeMeasurement& m : all) {
    const auto base = std::find_if(all.begin(), all.end(), [&m](const auto& other) { return other.name == m.against; });
    if (base != all.end() && base->median_ms > 0) m.ratio = m.median_ms / base->median_ms;
  }
  return all;
}

std::string json_line(const TapeMeasurement& m) {
  nlohmann::ordered_json line = {{"nodes", m.nodes}, {"ns_per_node", m.ns_each()}};
  if (m.nodes == 0) line = {{"elements", m.elements}, {"ns_per_element", m.ns_each()}};
  if (m.ratio) line.update({{"against", m.against}, {"ratio", *m.ratio}});
  if (m.goal) line["goal"] = *m.goal;
  return bench_line(m, line.dump());
}

/// What was asked of a measurement, and what came of it; nothing where nothing was.
std::string goal_text(const TapeMeasurement& m) {
  if (!m.goal) return "";
  return m.ratio ? formatted("%.2f of %s, at most %.3g", *m.ratio, m.against.c_str(), *m.goal)
                 : formatted("at most %.3g ns", *m.goal);
}

BenchText measure_tape(const BenchOptions& options) {
  std::string json;
  Table table{.head = {"", "median us", "least us", "ns each", "of"}, .align = "lrrrrl"};
  for (const TapeMeasurement& m : bench_tape(options)) {
    table.rows.push_back({m.name, Cell(1e3 * m.median_ms, 3), Cell(1e3 * m.min_ms, 3), Cell(m.ns_each(), 2),
                          m.nodes > 0 ? std::to_string(m.nodes) + " nodes" : std::to_string(m.elements) + " rows",
                          goal_text(m)});
    json += json_line(m);
  }
  return {table_text(table), std::move(json)};
}

}  // namespace

BenchTopic tape_topic() {
  return {"tape", "Measure what a node of the tape costs, and lambda losses against their values alone", measure_tape,
          false};
}

}  // namespace hsi4d::cli
