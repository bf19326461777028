// `hsi4d bench rasterize`: time and counts of the renderer's steps on made-up workloads.
#include <algorithm>
#include <array>
#include <functional>
#include <span>

#include <nlohmann/json.hpp>

#include "bench/fma_peak.h"
#include "bench/iteration.h"
#include "bench/list.h"
#include "bench/measurement.h"
#include "bench/workloads.h"
#include "core/parallel.h"
#include "core/table.h"
#include "splat/render/covariance.h"
#include "splat/render/render.h"

namespace hsi4d::cli {

namespace {

struct RenderWorkload {
  const char* name;
  Workload (*make)(const WorkloadSize&);
};
constexpr std::array<RenderWorkload, 4> kRenderWorkloads = {
    {{"avatar", avatar_workload},
     {"scene", scene_workload},
     {"avatar_in_scene", avatar_in_scene_workload},
     {"small", [](const WorkloadSize&) { return small_workload(); }}}};

/// A workload on a tape, projected once: what is measured starts at the image plane.
struct RecordedRender {
  Tape<float> tape;
  Projected<float> projected;
  Var<float> opacities, colors;
  Composited<float> composited;
  std::vector<float> cotangent;

  RecordedRender(const Workload& w, bool with_colors) {
    const auto parameter = [&](const char* name, Index cols, const std::vector<float>& values, bool frozen) {
      const Var<float> var =
          frozen ? tape.constant(name, shape_of(w.count, cols)) : tape.parameter(name, shape_of(w.count, cols));
      std::copy(values.begin(), values.end(), tape.write(var).data);
      return var;
    };
    const Var<float> means = parameter("means", 3, w.means, false), quats = parameter("quats", 4, w.quats, false);
    const Var<float> scales = parameter("log_scales", 3, w.log_scales, false);
    opacities = parameter("opacities", 1, w.opacities, false);
    colors = parameter("colors", 3, w.colors, !with_colors);
    const Var<float> xi = tape.constant("xi", shape_of(1, 6));
    projected = project(means, gaussian_axes(quats, scales), xi, w.view);
    composited = composite(SplatSet<float>{projected, opacities, colors}, w.view);
    const auto pixels = static_cast<std::size_t>(w.view.camera.width) * static_cast<std::size_t>(w.view.camera.height);
    cotangent.resize(3 * pixels);
    for (std::size_t i = 0; i < cotangent.size(); ++i) cotangent[i] = 1 + 0.001f * static_cast<float>(i % 977);
  }
  void run(bool backward) {
    tape.write(opacities);
    tape.forward(composited.channels);
    if (backward) tape.backward(composited.channels, cotangent);
  }
};

/// A step of an iteration and what it does.
struct Step {
  const char* name;
  double RenderTimes::*time;
  WorkUnit unit;
  double operations =
      0;  ///< on the vector ports for a group of 16 lanes (docs/numerics/measurements.md); 0: not counted
};
constexpr double kLanes = 16;  // a block of 4×4 pixels
constexpr double kForward = 20, kBackward = 17 + 6 + 8 + 7, kBackwardOfColors = 2 + 3 + 1;
constexpr std::array<Step, 6> kSteps = {{{"records", &RenderTimes::records_s, WorkUnit::kGaussians},
                                         {"sort", &RenderTimes::sort_s, WorkUnit::kGaussians},
                                         {"bin", &RenderTimes::bin_s, WorkUnit::kPairs},
                                         {"forward", &RenderTimes::forward_s, WorkUnit::kFragments, kForward},
                                         {"backward", &RenderTimes::backward_s, WorkUnit::kFragments, kBackward},
                                         {"reduce", &RenderTimes::reduce_s, WorkUnit::kGaussians}}};
constexpr std::array<Step, 2> kStepsWithColors = {
    {{"backward_with_colors", &RenderTimes::backward_s, WorkUnit::kFragments, kBackward + kBackwardOfColors},
     {"reduce_with_colors", &RenderTimes::reduce_s, WorkUnit::kGaussians}}};

void bench_steps(const Workload& w, const BenchOptions& options,
                 const std::function<void(const Measurement&)>& report) {
  const double peak = fma_peak_per_second();
  for (const bool with_colors : {false, true}) {
    RecordedRender recorded(w, with_colors);
    const RenderCounters& counters = *recorded.composited.counters;
    std::vector<RenderTimes> times;
    recorded.run(true);  // memory
    for (int i = 0; i < options.repeats; ++i) {
      recorded.run(true);
      times.push_back(counters.times);
    }
    const std::span<const Step> steps = with_colors ? std::span<const Step>(kStepsWithColors) : kSteps;
    for (const Step& step : steps) {
      std::vector<double> seconds;
      for (const RenderTimes& t : times) seconds.push_back(t.*step.time);
      Measurement m = measured(w, counters, options.threads, step.name, seconds);
      m.unit = step.unit;
      m.operations = step.operations * kLanes * static_cast<double>(counters.groups);
      m.fma_peak_per_s = peak;
      report(m);
    }
  }
}

const char* unit_name(WorkUnit unit) {
  return unit == WorkUnit::kGaussians ? "gaussians" : unit == WorkUnit::kPairs ? "pairs" : "fragments";
}

std::string json_line(const Measurement& m) {
  nlohmann::ordered_json line = {{"gaussians", m.gaussians},
                                 {"fragments", m.fragments},
                                 {"groups", m.groups},
                                 {"pairs", m.pairs},
                                 {"tiles", m.tiles},
                                 {"pixels", m.pixels},
                                 {"kept_bytes", m.kept_bytes},
                                 {"unit", unit_name(m.unit)},
                                 {"millions_per_s", m.millions_per_s()},
                                 {"peak_memory_bytes", m.peak_memory_bytes}};
  if (m.unit == WorkUnit::kFragments) line["mfragments_per_s"] = m.millions_per_s();
  if (m.fma_peak_per_s > 0) line["fma_peak_per_s"] = m.fma_peak_per_s;
  if (m.peak_share()) line["fma_peak_share"] = *m.peak_share();
  if (m.image_error) line["image_error"] = *m.image_error;
  if (m.gradient_error) line["gradient_error"] = *m.gradient_error;
  return bench_line(m, line.dump());
}

BenchText measure_rasterize(const BenchOptions& options) {
  std::string json;
  Table table{.head = {"", "median ms", "least ms", "tiles", "pairs", "fragments", "M/s", "of", "peak %", ""},
              .align = "lrrrrrrlrl"};
  double peak = 0;
  const auto report = [&](const Measurement& m) {
    table.rows.push_back({m.name, Cell(m.median_ms, 3), Cell(m.min_ms, 3), m.tiles, m.pairs, m.fragments,
                          Cell(m.millions_per_s(), 0), unit_name(m.unit)});
    table.rows.back().push_back(m.peak_share() ? Cell(100 * *m.peak_share(), 1) : Cell());
    if (m.image_error && m.gradient_error)
      table.rows.back().emplace_back(formatted("image within %.2g, gradients within %.2g (relative L2) of all rendered",
                                               *m.image_error, *m.gradient_error));
    json += json_line(m);
    peak = std::max(peak, m.fma_peak_per_s);
  };
  for (const RenderWorkload& named : chosen_workloads("rasterize", options.workloads, kRenderWorkloads)) {
    const Workload workload = named.make({});
    with_threads(options.threads, [&] {
      bench_steps(workload, options, report);
      if (workload.moving_begin > 0 && workload.moving_begin < workload.count)
        bench_iteration(workload, options, report);
    });
  }
  return {table_text(table) + peak_line(peak), std::move(json)};
}

}  // namespace

BenchTopic rasterize_topic() {
  return {"rasterize", "Measure every step of the renderer, forward and backward", measure_rasterize};
}

}  // namespace hsi4d::cli
