#include <algorithm>
#include <cmath>

#include <nlohmann/json.hpp>

#include "bench/machine.h"
#include "bench/scaling.h"
#include "core/table.h"
#include "pipelines/report/figure.h"

namespace hsi4d {

namespace {

// --- table -----------------------------------------------------------------------------------------------------------

/// An exponent, or a dash.
std::string exponent_text(const std::optional<double>& exponent) { return exponent ? fixed_number(*exponent, 2) : "-"; }

/// What all points of the axis share.
std::string others_text(const ScalingResult& result) {
  const ScalingPoint& first = result.points.front();
  std::string text;
  if (result.axis.name != "scene") text += formatted(", scene %lld", static_cast<long long>(first.scene_gaussians));
  if (result.axis.name != "avatar") text += formatted(", human %lld", static_cast<long long>(first.avatar_gaussians));
  text += formatted(", objects %lld Gaussians", static_cast<long long>(first.object_gaussians));
  if (result.axis.name != "threads") text += formatted(", threads %d", first.threads);
  return text;
}

// --- picture ---------------------------------------------------------------------------------------------------------

/// The fitted line, or that of the expected growth through the middle of what was measured.
Series growth_line(const std::vector<std::pair<double, double>>& measured, double exponent, double scale,
                   const std::string& label, const std::string& color) {
  Series line{.label = label, .color = color, .points = {}};
  for (const double x : {measured.front().first, measured.back().first})
    line.points.emplace_back(x, scale * std::pow(x, exponent));
  return line;
}

/// The scale with which scale · x^exponent goes through the mean of the logarithms.
double scale_through(const std::vector<std::pair<double, double>>& measured, double exponent) {
  double sum = 0;
  for (const auto& [x, y] : measured) sum += std::log(y) - exponent * std::log(x);
  return std::exp(sum / static_cast<double>(measured.size()));
}

void add_stage_lines(const ScalingResult& result, std::size_t s, const ScalingFit& fit, Plot& plot) {
  const std::string color = part_color(s);
  Series dots{.label = fit.stage, .color = color, .points = {}, .line = 0, .dots = 3};
  for (const ScalingPoint& point : result.points) {
    const ScalingCost& cost = point.stages[s];
    dots.points.emplace_back(static_cast<double>(point.value),
                             fit.quantity == "least ms" ? cost.min_ms : cost.processor_ms);
  }
  plot.series.push_back(dots);
  if (fit.fitted)
    plot.series.push_back(growth_line(dots.points, *fit.fitted, fit.scale, fit.stage + ", fitted", color));
  if (!fit.expected || !fit.fitted) return;
  Series expected = growth_line(dots.points, *fit.expected, scale_through(dots.points, *fit.expected),
                                fit.stage + ", expected", color);
  expected.is_dashed = true;
  plot.series.push_back(expected);
}

/// "camera: exponent 0.62, expected 0.70".
std::string fit_text(const ScalingFit& fit) {
  return fit.stage + (fit.fitted ? ": exponent " + exponent_text(fit.fitted) : "") +
         (fit.fitted && fit.expected ? ", expected " + exponent_text(fit.expected) : "");
}

/// Of threads what people wait for, where these do not have to share the processor; of all else what does not depend on
/// that.
std::string drawn_quantity(const ScalingAxis& axis) { return axis.name == "threads" ? "least ms" : "processor ms"; }

Plot growth_panel(const ScalingResult& result) {
  const std::string quantity = drawn_quantity(result.axis);
  Plot plot{.title = result.axis.name + ", " + quantity,
            .x_label = result.axis.label,
            .unit = "ms",
            .series = {},
            .is_log = true,
            .is_log_x = true,
            .width = kPanelWidth,
            .height = kPanelHeight};
  for (const ScalingPoint& point : result.points) plot.ticks_x.push_back(static_cast<double>(point.value));
  for (const ScalingFit& fit : scaling_fits(result.axis, result.points)) {
    if (fit.quantity != quantity) continue;
    const std::size_t s = plot.legend.size();
    plot.legend.emplace_back(fit_text(fit), part_color(s));
    add_stage_lines(result, s, fit, plot);
  }
  return plot;
}

nlohmann::ordered_json json_of(const ScalingResult& result, const ScalingPoint& point, const ScalingCost& cost) {
  return {{"name", "scaling/" + result.axis.name + " " + std::to_string(point.value) + "/" + cost.stage},
          {"axis", result.axis.name},
          {"value", point.value},
          {"stage", cost.stage},
          {"threads", point.threads},
          {"median_ms", cost.ms},
          {"min_ms", cost.min_ms},
          {"repeats", cost.repeats},
          {"gaussians", point.scene_gaussians + point.avatar_gaussians + point.object_gaussians},
          {"scene_gaussians", point.scene_gaussians},
          {"avatar_gaussians", point.avatar_gaussians},
          {"object_gaussians", point.object_gaussians},
          {"pixels", point.pixels},
          {"processor_ms", cost.processor_ms},
          {"first_ms", cost.first_ms},
          {"prepare_ms", cost.prepare_ms},
          {"forward_ms", cost.forward_ms},
          {"backward_ms", cost.backward_ms},
          {"other_ms", cost.other_ms()},
          {"channels", cost.channels},
          {"tiles", cost.tiles},
          {"pairs", cost.pairs},
          {"fragments", cost.fragments},
          {"mfragments_per_s", cost.ms > 0 ? static_cast<double>(cost.fragments) / cost.ms / 1e3 : 0},
          {"peak_memory_bytes", point.peak_memory_bytes}};
}

}  // namespace

std::string scaling_table(const std::vector<ScalingResult>& results) {
  std::string text;
  for (const ScalingResult& result : results) {
    Table costs{.head = {"", "stage", "ms", "least", "proc. ms", "first ms", "prepare", "forward", "backward", "other",
                         "tiles", "pairs", "fragments"},
                .align = "rlr"};
    for (const ScalingPoint& point : result.points) {
      for (const ScalingCost& cost : point.stages)
        costs.rows.push_back({point.value, cost.stage, Cell(cost.ms, 2), Cell(cost.min_ms, 2),
                              Cell(cost.processor_ms, 2), Cell(cost.first_ms, 2), Cell(cost.prepare_ms, 2),
                              Cell(cost.forward_ms, 2), Cell(cost.backward_ms, 2), Cell(cost.other_ms(), 2), cost.tiles,
                              cost.pairs, cost.fragments});
    }
    Table fits{.head = {"exponent of", "", "expected", "fitted"}, .align = "llrrl"};
    for (const ScalingFit& fit : scaling_fits(result.axis, result.points))
      fits.rows.push_back(
          {fit.stage, fit.quantity, exponent_text(fit.expected), exponent_text(fit.fitted), fit.reason});
    text += (text.empty() ? "" : "\n") + result.axis.name + ": " + result.axis.label + others_text(result) + "\n" +
            table_text(costs) + table_text(fits);
  }
  return text;
}

std::string scaling_json(const std::vector<ScalingResult>& results) {
  std::string text;
  for (const ScalingResult& result : results) {
    for (const ScalingPoint& point : result.points)
      for (const ScalingCost& cost : point.stages) text += bench_line(json_of(result, point, cost).dump());
    for (const ScalingFit& fit : scaling_fits(result.axis, result.points)) {
      nlohmann::ordered_json line = {{"axis", result.axis.name}, {"stage", fit.stage}, {"quantity", fit.quantity}};
      if (fit.expected) line["expected"] = *fit.expected;
      if (fit.fitted) line["fitted"] = *fit.fitted;
      text += line.dump() + "\n";
    }
  }
  return text;
}

std::string scaling_svg(const std::vector<ScalingResult>& results, const std::string& title) {
  PictureSection section{.title = title, .note = "dots: measured, lines: fitted, dashed: expected"};
  for (const ScalingResult& result : results) section.plots.push_back(growth_panel(result));
  return picture_svg({section});
}

}  // namespace hsi4d
