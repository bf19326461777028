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
#include "core/formatted.h"

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

/// " 34.5" of a hundred, or nothing.
std::string share_text(const Measurement& m) {
  return m.peak_share() ? formatted(" %6.1f", 100 * *m.peak_share()) : "";
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
  std::string json, table;
  table += formatted("%-44s %10s %10s %7s %10s %12s %8s %-9s %6s\n", "", "median ms", "least ms", "tiles", "pairs",
                     "fragments", "M/s", "of", "peak %");
  double peak = 0;
  bench_rasterize({options.workloads, options.threads, options.repeats}, [&](const Measurement& m) {
    table += formatted("%-44s %10.3f %10.3f %7lld %10lld %12lld %8.0f %-9s", m.name.c_str(), m.median_ms, m.min_ms,
                       static_cast<long long>(m.tiles), static_cast<long long>(m.pairs),
                       static_cast<long long>(m.fragments), m.millions_per_s(), unit_name(m.unit)) +
             share_text(m) + "\n";
    if (m.image_error && m.gradient_error) {
      table += formatted("%-44s image within %.2g, gradients within %.2g (relative L2) of all rendered\n", "",
                         *m.image_error, *m.gradient_error);
    }
    json += json_line(m);
    peak = std::max(peak, m.fma_peak_per_s);
  });
  table += peak_line(peak);
  return {std::move(table), std::move(json)};
}

BenchText measure_skinning(const BenchOptions& options) {
  std::string json, table;
  table += formatted("%-40s %10s %10s %9s %8s %10s %7s\n", "", "median ms", "least ms", "points", "columns", "MB read",
                     "GB/s");
  bench_skinning({options.workloads, options.threads, options.repeats}, [&](const SkinningMeasurement& m) {
    table += formatted("%-40s %10.3f %10.3f %9lld %8lld %10s %7s\n", m.name.c_str(), m.median_ms, m.min_ms,
                       static_cast<long long>(m.vertices + m.gaussians), static_cast<long long>(m.corrective_columns),
                       tenths(bytes_read(m) / 1e6).c_str(), tenths(rate(m)).c_str());
    json += json_line(m);
  });
  return {std::move(table), std::move(json)};
}

BenchText measure_color_net(const BenchOptions& options) {
  std::string json, table;
  table += formatted("%-36s %10s %10s %9s %6s %6s %10s %7s\n", "", "median ms", "least ms", "gaussians", "width",
                     "layers", "M mul-add", "peak %");
  double peak = 0;
  bench_color_net({options.workloads, options.threads, options.repeats}, [&](const ColorNetMeasurement& m) {
    table += formatted("%-36s %10.3f %10.3f %9lld %6lld %6lld %10s %7s\n", m.name.c_str(), m.median_ms, m.min_ms,
                       static_cast<long long>(m.gaussians), static_cast<long long>(m.hidden_width),
                       static_cast<long long>(m.hidden_layers), tenths(1e-6 * m.multiply_adds).c_str(),
                       tenths(100 * m.peak_share()).c_str());
    json += json_line(m);
    peak = std::max(peak, m.fma_peak_per_s);
  });
  table += peak_line(peak);
  return {std::move(table), std::move(json)};
}

/// What was asked of a measurement, and what came of it; nothing where nothing was.
std::string goal_text(const TapeMeasurement& m) {
  if (!m.goal) return "";
  return m.ratio ? formatted("%.2f of %s, at most %.3g", *m.ratio, m.against.c_str(), *m.goal)
                 : formatted("at most %.3g ns", *m.goal);
}

BenchText measure_tape(const BenchOptions& options) {
  BenchText text;
  text.table = formatted("%-28s %12s %12s %9s %9s\n", "", "median us", "least us", "ns each", "of");
  for (const TapeMeasurement& m : bench_tape({options.workloads, options.repeats})) {
    const std::string what = m.nodes > 0 ? formatted("%lld nodes", static_cast<long long>(m.nodes))
                                         : formatted("%lld rows", static_cast<long long>(m.elements));
    text.table += formatted("%-28s %12.3f %12.3f %9.2f %12s  %s\n", m.name.c_str(), 1e3 * m.median_ms, 1e3 * m.min_ms,
                            m.ns_each(), what.c_str(), goal_text(m).c_str());
    text.json += json_line(m);
  }
  return text;
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
  std::string json, table;
  table += formatted("%-50s %9s %9s %9s %9s %9s %8s %8s %10s\n", "", "sigma px", "blur px2", "width px", "half px",
                     "size px", "light %", "rms", "distance %");
  PixelFilterBench bench;
  bench.figures = options.workloads;
  bench.threads = options.threads;
  if (!options.heights_px.empty()) bench.heights_px = options.heights_px;
  bench_pixel_filter(bench, [&](const FilterMeasurement& m) {
    const SilhouetteError& e = m.error;
    table += formatted("%-50s %9.2f %9.4f %+9.3f %+9.3f %+9.3f %+8.2f %8.4f %+10.2f\n", m.name.c_str(), m.sigma_px,
                       m.blur, e.width_px, e.half_width_px, m.distance_error * m.height_px, 100 * e.brightness, e.rms,
                       100 * m.distance_error);
    json += json_line(m);
  });
  if (!options.json.empty()) write_text_file(options.json, json);
  return table;
}

}  // namespace hsi4d::cli
