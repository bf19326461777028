// `hsi4d bench color_net`: time of a human's color net on the tape, forward and backward.
#include "body/color_net.h"

#include <algorithm>
#include <array>
#include <functional>

#include <nlohmann/json.hpp>

#include "bench/fma_peak.h"
#include "bench/list.h"
#include "bench/timing.h"
#include "core/parallel.h"
#include "core/random.h"
#include "core/stopwatch.h"
#include "core/table.h"

namespace hsi4d::cli {

namespace {

/// One step of one workload: `forward`; `both`, forward and backward with all that may move; `pose`, the same with
/// network and features frozen, as between the network's steps.
struct ColorNetMeasurement : BenchTime {
  Index gaussians = 0, features = 0, hidden_width = 0, hidden_layers = 0;
  double multiply_adds = 0;   ///< of the matrices, those that the backward pass repeats included
  double fma_peak_per_s = 0;  ///< measured just before, on as many threads; 0: no multiply-adds

  /// Multiply-adds a second by the least time, as a share of the peak; 0 where that is not known.
  double peak_share() const {
    return fma_peak_per_s > 0 && min_ms > 0 ? multiply_adds / (1e-3 * min_ms) / fma_peak_per_s : 0;
  }
};

constexpr Index kRows = 50000, kJoints = 55;

struct NetWorkload {
  const char* name;
  Index hidden_width, hidden_layers;
  bool view_direction;
};
constexpr std::array<NetWorkload, 5> kNetWorkloads = {{{"default", 32, 2, false},
                                                       {"view_direction", 32, 2, true},
                                                       {"narrow", 16, 2, false},
                                                       {"wide", 64, 2, false},
                                                       {"deep", 32, 4, false}}};

/// A color net on a tape, with its inputs.
struct RecordedNet {
  Tape<float> tape;
  ColorNetVars<float> net;
  Var<float> colors, code, directions, rgb;
  std::vector<float> cotangent;
  double multiply_adds = 0;  // of one forward run

  explicit RecordedNet(const NetWorkload& w) {
    RandomSequence random(0, random_stream("bench.color_net"));
    const auto fill = [&](Var<float> var, double low, double high) {
      const Array<float> numbers = tape.write(var);
      for (Index i = 0; i < numbers.shape.count(); ++i) numbers.data[i] = static_cast<float>(random.uniform(low, high));
      return var;
    };
    std::vector<float> means;
    for (Index i = 0; i < 3 * kRows; ++i) means.push_back(static_cast<float>(random.uniform(-1, 1)));
    ColorNet numbers = new_color_net(means, kJoints, {16, w.hidden_width, w.hidden_layers, w.view_direction, 0});
    for (double& x : numbers.layers.back().weights) x = random.uniform(-0.3, 0.3);
    net = color_net_leaves(tape, numbers);
    colors = fill(tape.constant("colors", shape_of(kRows, 3)), 0, 1);
    code = fill(tape.parameter("code", shape_of(1, numbers.code_size())), -0.3, 0.3);
    if (w.view_direction) directions = fill(tape.parameter("directions", shape_of(kRows, 3)), -1, 1);
    rgb = color_net(net, colors, code, directions);
    std::vector<Index> widths = {numbers.layers.front().inputs - numbers.code_size()};
    for (const ColorNet::Layer& layer : numbers.layers) widths.push_back(layer.outputs);
    multiply_adds = mlp_multiply_adds(kRows, widths);
    for (Index i = 0; i < 3 * kRows; ++i) cotangent.push_back(static_cast<float>(random.uniform(-1, 1)));
  }

  void freeze_net() {
    tape.freeze(net.features);
    for (const MlpLayer<float>& layer : net.layers) {
      tape.freeze(layer.weights);
      tape.freeze(layer.bias);
    }
  }

  /// Seconds of a run in another pose: forward, and both.
  std::array<double, 2> run() {
    tape.write(code).data[0] += 1e-3F;
    Stopwatch watch;
    tape.forward(rgb);
    const double forward = watch.lap();
    tape.backward(rgb, cotangent);
    return {forward, forward + watch.lap()};
  }
};

void bench_net(const NetWorkload& w, const BenchOptions& options,
               const std::function<void(const ColorNetMeasurement&)>& report) {
  constexpr int kWarmUp = 3;
  const double peak = fma_peak_per_second();
  RecordedNet recorded(w);
  std::vector<double> forward, both, pose;
  for (int i = -kWarmUp; i < options.repeats; ++i) {
    const auto [first, all] = recorded.run();
    if (i < 0) continue;
    forward.push_back(first);
    both.push_back(all);
  }
  recorded.freeze_net();
  for (int i = -kWarmUp; i < options.repeats; ++i) {
    const double all = recorded.run()[1];
    if (i >= 0) pose.push_back(all);
  }
  const auto measured = [&](const char* step, const std::vector<double>& seconds, double multiply_adds) {
    ColorNetMeasurement m{bench_time(std::string("color_net/") + w.name + "/" + step, options.threads, seconds)};
    m.gaussians = kRows;
    m.features = 16;
    m.hidden_width = w.hidden_width;
    m.hidden_layers = w.hidden_layers;
    m.multiply_adds = multiply_adds;
    m.fma_peak_per_s = peak;
    report(m);
  };
  const double once = recorded.multiply_adds;
  const double first_layer =  // through which no gradient goes back where only the pose is wanted
      mlp_multiply_adds(kRows, std::array<Index, 2>{w.view_direction ? 19 : 16, w.hidden_width});
  measured("forward", forward, once);
  measured("both", both, 4 * once);  // forward, again, to inputs, to weights
  const double to_directions = w.view_direction ? mlp_multiply_adds(kRows, std::array<Index, 2>{3, w.hidden_width}) : 0;
  measured("pose", pose, 3 * once - first_layer + to_directions);
}

std::string json_line(const ColorNetMeasurement& m) {
  nlohmann::ordered_json line = {{"gaussians", m.gaussians},
                                 {"features", m.features},
                                 {"hidden_width", m.hidden_width},
                                 {"hidden_layers", m.hidden_layers},
                                 {"multiply_adds", m.multiply_adds}};
  if (m.fma_peak_per_s > 0) {
    line["fma_peak_per_s"] = m.fma_peak_per_s;
    line["fma_peak_share"] = m.peak_share();
  }
  return bench_line(m, line.dump());
}

/// 50,000 Gaussians with 16 features, in float.
BenchText measure_color_net(const BenchOptions& options) {
  std::string json;
  Table table{.head = {"", "median ms", "least ms", "gaussians", "width", "layers", "M mul-add", "peak %"},
              .align = "lr"};
  double peak = 0;
  const auto report = [&](const ColorNetMeasurement& m) {
    table.rows.push_back({m.name, Cell(m.median_ms, 3), Cell(m.min_ms, 3), m.gaussians, m.hidden_width, m.hidden_layers,
                          tenths(1e-6 * m.multiply_adds), tenths(100 * m.peak_share())});
    json += json_line(m);
    peak = std::max(peak, m.fma_peak_per_s);
  };
  for (const NetWorkload& workload : chosen_workloads("color_net", options.workloads, kNetWorkloads))
    with_threads(options.threads, [&] { bench_net(workload, options, report); });
  return {table_text(table) + peak_line(peak), std::move(json)};
}

}  // namespace

BenchTopic color_net_topic() { return {"color_net", "Measure the color net, forward and backward", measure_color_net}; }

}  // namespace hsi4d::cli
