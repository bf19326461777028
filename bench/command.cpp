#include "bench/command.h"

#include <algorithm>
#include <utility>

#include <nlohmann/json.hpp>

#include "bench/color_net.h"
#include "bench/machine.h"
#include "bench/pixel_filter_table.h"
#include "bench/rasterize.h"
#include "bench/skinning.h"
#include "bench/tape.h"
#include "core/check.h"
#include "core/file.h"
#include "core/table.h"

namespace hsi4d::cli {

namespace {

const char* unit_name(WorkUnit unit) {
  return unit == WorkUnit::kGaussians ? "gaussians" : unit == WorkUnit::kPairs ? "pairs" : "fragments";
}

std::string json_line(const Measurement& m) {
  nlohmann::ordered_json line = {{"name", m.name},
                                 {"threads", m.threads},
                                 {"median_ms", m.median_ms},
                                 {"min_ms", m.min_ms},
                                 {"repeats", m.repeats},
                                 {"gaussians", m.gaussians},
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
  return bench_line(line.dump());
}

/// What shares are of; nothing where none was measured.
std::string peak_line(double peak) {
  if (!(peak > 0)) return "";
  return formatted("peak %%: of the %.1f G multiply-adds a second that were measured beside it\n", 1e-9 * peak);
}

std::string json_line(const FilterMeasurement& m) {
  const nlohmann::ordered_json line = {{"name", m.name},
                                       {"gaussians", m.gaussians},
                                       {"height_px", m.height_px},
                                       {"distance_m", m.distance_m},
                                       {"sigma_px", m.sigma_px},
                                       {"blur", m.blur},
                                       {"antialias", m.antialias},
                                       {"width_px", m.error.width_px},
                                       {"half_width_px", m.error.half_width_px},
                                       {"brightness", m.error.brightness},
                                       {"rms", m.error.rms},
                                       {"distance_error", m.distance_error}};
  return line.dump() + "\n";
}

/// Of the correctives, by forward and backward; 0 where there are none.
double bytes_read(const SkinningMeasurement& m) {
  return (m.name.ends_with("/both") ? 2 : 1) * static_cast<double>(m.table_bytes);
}

/// Billions of them a second.
double rate(const SkinningMeasurement& m) { return m.median_ms > 0 ? bytes_read(m) / m.median_ms / 1e6 : 0; }

/// With one decimal; a dash for nothing.
std::string tenths(double value) { return value > 0 ? formatted("%.1f", value) : "-"; }

std::string json_line(const SkinningMeasurement& m) {
  nlohmann::ordered_json line = {{"name", m.name},
                                 {"threads", m.threads},
                                 {"median_ms", m.median_ms},
                                 {"min_ms", m.min_ms},
                                 {"repeats", m.repeats}};
  if (m.gaussians > 0) {
    line.update({{"gaussians", m.gaussians}, {"joints", m.joints}});
    return bench_line(line.dump());
  }
  line.update({{"vertices", m.vertices},
               {"joints", m.joints},
               {"corrective_columns", m.corrective_columns},
               {"table_bytes", m.table_bytes},
               {"packing_error_m", m.packing_error_m},
               {"gbytes_per_s", rate(m)}});
  return bench_line(line.dump());
}

std::string json_line(const ColorNetMeasurement& m) {
  nlohmann::ordered_json line = {{"name", m.name},
                                 {"threads", m.threads},
                                 {"median_ms", m.median_ms},
                                 {"min_ms", m.min_ms},
                                 {"repeats", m.repeats},
                                 {"gaussians", m.gaussians},
                                 {"features", m.features},
                                 {"hidden_width", m.hidden_width},
                                 {"hidden_layers", m.hidden_layers},
                                 {"multiply_adds", m.multiply_adds}};
  if (m.fma_peak_per_s > 0) {
    line["fma_peak_per_s"] = m.fma_peak_per_s;
    line["fma_peak_share"] = m.peak_share();
  }
  return bench_line(line.dump());
}

std::string json_line(const TapeMeasurement& m) {
  nlohmann::ordered_json line = {
      {"name", m.name}, {"threads", 1}, {"median_ms", m.median_ms}, {"min_ms", m.min_ms}, {"repeats", m.repeats}};
  line.update(m.nodes > 0 ? nlohmann::ordered_json{{"nodes", m.nodes}, {"ns_per_node", m.ns_each()}}
                          : nlohmann::ordered_json{{"elements", m.elements}, {"ns_per_element", m.ns_each()}});
  if (m.ratio) line.update({{"against", m.against}, {"ratio", *m.ratio}});
  if (m.goal) line["goal"] = *m.goal;
  return bench_line(line.dump());
}

/// What a topic measured: for people, and for programs.
struct BenchText {
  std::string table, json;
};

/// The table of a topic whose measurements go into the file that was asked for.
std::string written(const BenchText& text, const BenchOptions& options) {
  if (!options.json.empty()) write_text_file(options.json, text.json);
  return text.table;
}

BenchText measure_rasterize(const BenchOptions& options) {
  std::string json;
  Table table{.head = {"", "median ms", "least ms", "tiles", "pairs", "fragments", "M/s", "of", "peak %", ""},
              .align = "lrrrrrrlrl"};
  double peak = 0;
  bench_rasterize({options.workloads, options.threads, options.repeats}, [&](const Measurement& m) {
    table.rows.push_back({m.name, Cell(m.median_ms, 3), Cell(m.min_ms, 3), m.tiles, m.pairs, m.fragments,
                          Cell(m.millions_per_s(), 0), unit_name(m.unit)});
    table.rows.back().push_back(m.peak_share() ? Cell(100 * *m.peak_share(), 1) : Cell());
    if (m.image_error && m.gradient_error)
      table.rows.back().emplace_back(formatted("image within %.2g, gradients within %.2g (relative L2) of all rendered",
                                               *m.image_error, *m.gradient_error));
    json += json_line(m);
    peak = std::max(peak, m.fma_peak_per_s);
  });
  return {table_text(table) + peak_line(peak), std::move(json)};
}

BenchText measure_skinning(const BenchOptions& options) {
  std::string json;
  Table table{.head = {"", "median ms", "least ms", "points", "columns", "MB read", "GB/s"}, .align = "lr"};
  bench_skinning({options.workloads, options.threads, options.repeats}, [&](const SkinningMeasurement& m) {
    table.rows.push_back({m.name, Cell(m.median_ms, 3), Cell(m.min_ms, 3), m.vertices + m.gaussians,
                          m.corrective_columns, tenths(bytes_read(m) / 1e6), tenths(rate(m))});
    json += json_line(m);
  });
  return {table_text(table), std::move(json)};
}

BenchText measure_color_net(const BenchOptions& options) {
  std::string json;
  Table table{.head = {"", "median ms", "least ms", "gaussians", "width", "layers", "M mul-add", "peak %"},
              .align = "lr"};
  double peak = 0;
  bench_color_net({options.workloads, options.threads, options.repeats}, [&](const ColorNetMeasurement& m) {
    table.rows.push_back({m.name, Cell(m.median_ms, 3), Cell(m.min_ms, 3), m.gaussians, m.hidden_width, m.hidden_layers,
                          tenths(1e-6 * m.multiply_adds), tenths(100 * m.peak_share())});
    json += json_line(m);
    peak = std::max(peak, m.fma_peak_per_s);
  });
  return {table_text(table) + peak_line(peak), std::move(json)};
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
  for (const TapeMeasurement& m : bench_tape({options.workloads, options.repeats})) {
    table.rows.push_back({m.name, Cell(1e3 * m.median_ms, 3), Cell(1e3 * m.min_ms, 3), Cell(m.ns_each(), 2),
                          m.nodes > 0 ? std::to_string(m.nodes) + " nodes" : std::to_string(m.elements) + " rows",
                          goal_text(m)});
    json += json_line(m);
  }
  return {table_text(table), std::move(json)};
}

}  // namespace

std::string bench_rasterize_command(const BenchOptions& options) {
  return written(measure_rasterize(options), options);
}

std::string bench_skinning_command(const BenchOptions& options) { return written(measure_skinning(options), options); }

std::string bench_color_net_command(const BenchOptions& options) {
  return written(measure_color_net(options), options);
}

std::string bench_tape_command(const BenchOptions& options) { return written(measure_tape(options), options); }

std::string bench_kernels_command(const BenchOptions& options) {
  BenchText all;
  for (const auto measure : {measure_rasterize, measure_skinning, measure_color_net, measure_tape}) {
    const BenchText of_topic = measure(options);
    all.table += (all.table.empty() ? "" : "\n") + of_topic.table;
    all.json += of_topic.json;
  }
  return written(all, options);
}

std::string bench_pixel_filter_command(const BenchOptions& options) {
  std::string json;
  Table table{.head = {"", "sigma px", "blur px2", "width px", "half px", "size px", "light %", "rms", "distance %"},
              .align = "lr"};
  PixelFilterBench bench;
  bench.figures = options.workloads;
  bench.threads = options.threads;
  if (!options.heights_px.empty()) bench.heights_px = options.heights_px;
  bench_pixel_filter(bench, [&](const FilterMeasurement& m) {
    const SilhouetteError& e = m.error;
    table.rows.push_back({m.name, Cell(m.sigma_px, 2), Cell(m.blur, 4), formatted("%+.3f", e.width_px),
                          formatted("%+.3f", e.half_width_px), formatted("%+.3f", m.distance_error * m.height_px),
                          formatted("%+.2f", 100 * e.brightness), Cell(e.rms, 4),
                          formatted("%+.2f", 100 * m.distance_error)});
    json += json_line(m);
  });
  if (!options.json.empty()) write_text_file(options.json, json);
  return table_text(table);
}

}  // namespace hsi4d::cli
