#include "bench/color_net.h"

#include <algorithm>

#include "bench/fma_peak.h"
#include "body/color_net.h"
#include "core/check.h"
#include "core/parallel.h"
#include "core/random.h"
#include "core/stopwatch.h"
#include "core/suggest.h"
#include "core/text.h"

namespace hsi4d {

namespace {

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

void bench_workload(const NetWorkload& w, const ColorNetBench& options,
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
  const auto measured = [&](const char* step, std::vector<double> seconds, double multiply_adds) {
    std::sort(seconds.begin(), seconds.end());
    ColorNetMeasurement m;
    m.name = std::string("color_net/") + w.name + "/" + step;
    m.threads = options.threads;
    m.median_ms = 1e3 * seconds[seconds.size() / 2];
    m.min_ms = 1e3 * seconds.front();
    m.repeats = static_cast<int>(seconds.size());
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
  measured("forward", std::move(forward), once);
  measured("both", std::move(both), 4 * once);  // forward, again, to inputs, to weights
  const double to_directions = w.view_direction ? mlp_multiply_adds(kRows, std::array<Index, 2>{3, w.hidden_width}) : 0;
  measured("pose", std::move(pose), 3 * once - first_layer + to_directions);
}

}  // namespace

double ColorNetMeasurement::peak_share() const {
  return fma_peak_per_s > 0 && min_ms > 0 ? multiply_adds / (1e-3 * min_ms) / fma_peak_per_s : 0;
}

std::vector<std::string> color_net_workloads() {
  std::vector<std::string> names;
  for (const NetWorkload& w : kNetWorkloads) names.emplace_back(w.name);
  return names;
}

void bench_color_net(const ColorNetBench& options, const std::function<void(const ColorNetMeasurement&)>& report) {
  const std::vector<std::string> all = color_net_workloads();
  for (const std::string& name : options.workloads) {
    if (std::find(all.begin(), all.end(), name) == all.end())
      throw UserError("hsi4d bench color_net: no workload \"" + name + "\"; known: " + joined(all) +
                      did_you_mean(name, all));
  }
  for (const NetWorkload& workload : kNetWorkloads) {
    const auto& wanted = options.workloads;
    if (!wanted.empty() && std::find(wanted.begin(), wanted.end(), workload.name) == wanted.end()) continue;
    with_threads(options.threads, [&] { bench_workload(workload, options, report); });
  }
}

}  // namespace hsi4d
