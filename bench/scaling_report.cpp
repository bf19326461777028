#include <algorithm>
#include <cmath>

#include <nlohmann/json.hpp>

#include "bench/machine.h"
#include "bench/scaling.h"
#include "core/formatted.h"
#include "core/text.h"
#include "pipelines/report/plots.h"

namespace hsi4d {

namespace {

// --- table -----------------------------------------------------------------------------------------------------------

std::string point_lines(const ScalingPoint& point) {
  std::string text;
  for (const ScalingCost& cost : point.stages) {
    text += formatted("%10lld  %-12s %8.2f %8.2f %8.2f %8.2f", static_cast<long long>(point.value), cost.stage.c_str(),
                      cost.ms, cost.min_ms, cost.processor_ms, cost.first_ms) +
            formatted(" %8.2f %8.2f %8.2f %8.2f %6lld %9lld %11lld\n", cost.prepare_ms, cost.forward_ms,
                      cost.backward_ms, cost.other_ms(), static_cast<long long>(cost.tiles),
                      static_cast<long long>(cost.pairs), static_cast<long long>(cost.fragments));
  }
  return text;
}

/// An exponent, or a dash.
std::string exponent_text(const std::optional<double>& exponent) {
  return exponent ? formatted("%.2f", *exponent + 0.0) : "-";
}

std::string fit_line(const ScalingFit& fit) {
  return formatted("%10s  %-12s %-12s %8s %8s  %s\n", "", fit.stage.c_str(), fit.quantity.c_str(),
                   exponent_text(fit.expected).c_str(), exponent_text(fit.fitted).c_str(), fit.reason.c_str());
}

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

constexpr double kGrowthPanelWidth = 460, kGrowthPanelHeight = 254;  // as plots are: 210 high for 380, enlarged
constexpr double kGrowthTitle = 44, kGrowthHead = 60,
                 kGrowthGap = 26;  // of the picture; above and beside each growth_panel

/// The fitted line, or that of the expected growth through the middle of what was measured.
PlotLine growth_line(const std::vector<std::pair<double, double>>& measured, double exponent, double scale,
                     const std::string& label, const std::string& color) {
  PlotLine line{.label = label, .color = color, .points = {}};
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
  PlotLine dots{.label = fit.stage, .color = color, .points = {}, .has_dots = true, .opacity = 0};
  for (const ScalingPoint& point : result.points) {
    const ScalingCost& cost = point.stages[s];
    dots.points.emplace_back(static_cast<double>(point.value),
                             fit.quantity == "least ms" ? cost.min_ms : cost.processor_ms);
  }
  plot.lines.push_back(dots);
  if (fit.fitted) plot.lines.push_back(growth_line(dots.points, *fit.fitted, fit.scale, fit.stage + ", fitted", color));
  if (!fit.expected || !fit.fitted) return;
  PlotLine expected = growth_line(dots.points, *fit.expected, scale_through(dots.points, *fit.expected),
                                  fit.stage + ", expected", color);
  expected.is_dashed = true;
  plot.lines.push_back(expected);
}

/// "camera: exponent 0.62, expected 0.70" with the stage's colour before it.
std::string legend_entry(double x, double y, std::size_t s, const ScalingFit& fit) {
  std::string text = html_escape(fit.stage);
  if (fit.fitted) text += ": exponent " + exponent_text(fit.fitted);
  if (fit.fitted && fit.expected) text += ", expected " + exponent_text(fit.expected);
  return formatted("<circle cx=\"%.0f\" cy=\"%.0f\" r=\"4\" fill=\"%s\"/>", x + 5, y - 4, part_color(s).c_str()) +
         formatted("<text x=\"%.0f\" y=\"%.0f\">", x + 15, y) + text + "</text>\n";
}

/// Of threads what people wait for, where these do not have to share the processor; of all else what does not depend on
/// that.
std::string drawn_quantity(const ScalingAxis& axis) { return axis.name == "threads" ? "least ms" : "processor ms"; }

std::string growth_panel(const ScalingResult& result, double x, double y) {
  const std::string quantity = drawn_quantity(result.axis);
  Plot plot{.title = result.axis.label, .x_label = result.axis.label, .unit = "ms", .lines = {}};
  plot.is_log = plot.is_log_x = true;
  for (const ScalingPoint& point : result.points) plot.ticks_x.push_back(static_cast<double>(point.value));
  plot.attributes = formatted(" x=\"%.0f\" y=\"%.0f\" width=\"%.0f\" height=\"%.0f\"", x, y + kGrowthHead,
                              kGrowthPanelWidth, kGrowthPanelHeight);
  std::string head = formatted("<text x=\"%.0f\" y=\"%.0f\" font-weight=\"bold\">", x + 8, y + 12) +
                     html_escape(result.axis.name + ", " + quantity) + "</text>\n";
  std::size_t s = 0;
  for (const ScalingFit& fit : scaling_fits(result.axis, result.points)) {
    if (fit.quantity != quantity) continue;
    head += legend_entry(x + 8, y + 32 + 18 * static_cast<double>(s), s, fit);
    add_stage_lines(result, s++, fit, plot);
  }
  return head + plot_svg(plot) + "\n";
}

constexpr const char* kGrowthStyle =
    "<style>.plot text{font-size:11px;fill:#555}.plot .grid{stroke:#e4e4e4}.plot .axis{stroke:#888}"
    ".plot polyline{fill:none;stroke-width:1.6}</style>\n";

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
    text += (text.empty() ? "" : "\n") + result.axis.name + ": " + result.axis.label + others_text(result) + "\n";
    text += formatted("%10s  %-12s %8s %8s %8s %8s %8s %8s %8s %8s %6s %9s %11s\n", "", "stage", "ms", "least",
                      "proc. ms", "first ms", "prepare", "forward", "backward", "other", "tiles", "pairs", "fragments");
    for (const ScalingPoint& point : result.points) text += point_lines(point);
    text += formatted("%10s  %-12s %-12s %8s %8s\n", "", "exponent of", "", "expected", "fitted");
    for (const ScalingFit& fit : scaling_fits(result.axis, result.points)) text += fit_line(fit);
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
  std::string body;
  const double step_x = kGrowthPanelWidth + kGrowthGap, step_y = kGrowthHead + kGrowthPanelHeight + kGrowthGap;
  for (std::size_t i = 0; i < results.size(); ++i)
    body += growth_panel(results[i], kGrowthGap + step_x * static_cast<double>(i % 2),
                         kGrowthTitle + step_y * static_cast<double>(i / 2));
  const double columns = results.size() < 2 ? 1 : 2, rows = std::ceil(static_cast<double>(results.size()) / 2);
  const double width = kGrowthGap + columns * step_x, height = kGrowthTitle + rows * step_y;
  return formatted("<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %.0f %.0f\" ", width, height) +
         formatted("width=\"%.0f\" height=\"%.0f\" font-family=\"sans-serif\" font-size=\"12\" fill=\"#222\">\n", width,
                   height) +
         kGrowthStyle + formatted("<rect width=\"%.0f\" height=\"%.0f\" fill=\"#fff\"/>\n", width, height) +
         formatted("<text x=\"%.0f\" y=\"26\" font-size=\"16\">", kGrowthGap + 8) + html_escape(title) + "</text>\n" +
         formatted("<text x=\"%.0f\" y=\"26\" text-anchor=\"end\" fill=\"#555\">", width - kGrowthGap) +
         (columns > 1 ? "dots: measured, lines: fitted, dashed: expected" : "") + "</text>\n" + body + "</svg>\n";
}

}  // namespace hsi4d
