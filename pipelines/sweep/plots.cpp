#include "pipelines/sweep/plots.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "core/text.h"
#include "pipelines/report/plots.h"
#include "pipelines/sweep/tables.h"

namespace hsi4d {
namespace {

// In the units of the view box, where letters are 12 high.
constexpr double kWidth = 420, kRow = 20, kTop = 6, kBottom = 30, kRight = 12;
constexpr double kLetter = 6.4;  // their mean width
constexpr double kMostLabel = 190;
constexpr int kTicks = 4;

std::string coordinate(double value) { return fixed_number(value, 1); }

/// The step of 1, 2 or 5 times a power of ten that cuts `span` into at most kTicks pieces.
double nice_step(double span) {
  const double rough = span / kTicks, power = std::pow(10, std::floor(std::log10(rough)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * power >= rough * (1 - 1e-9)) return factor * power;
  }
  return 10 * power;
}

/// A label that fits; the whole of it is in the tooltip.
std::string fitted(const std::string& label) {
  const auto most = static_cast<std::size_t>(kMostLabel / kLetter);
  if (count_characters(label) <= most) return label;
  std::string cut;
  std::size_t count = 0;
  for (std::size_t i = 0; i < label.size() && count + 1 < most; ++count) {
    const std::size_t length = std::max<std::size_t>(1, utf8_length(std::string_view(label).substr(i)));
    cut += label.substr(i, length);
    i += length;
  }
  return cut + "…";
}

Interval extent_of(const std::vector<RangeRow>& rows, bool has_zero) {
  Interval all{std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
  const auto add = [&all](double value) { all = {std::min(all.low, value), std::max(all.high, value)}; };
  for (const RangeRow& row : rows) {
    for (const double value : row.points) add(value);
    add(row.middle);
    if (row.range) {
      add(row.range->low);
      add(row.range->high);
    }
  }
  if (has_zero) add(0);
  const double span = all.high - all.low, size = std::max(std::fabs(all.low), std::fabs(all.high));
  const double room = span > 1e-12 * size ? 0.05 * span : size > 0 ? 0.05 * size : 1;
  return {all.low - room, all.high + room};
}

std::string line_svg(double x1, double y1, double x2, double y2, const std::string& more) {
  return "<line x1=\"" + coordinate(x1) + "\" y1=\"" + coordinate(y1) + "\" x2=\"" + coordinate(x2) + "\" y2=\"" +
         coordinate(y2) + "\" " + more + "/>";
}

/// Where values are across a plot.
struct Across {
  Interval extent;
  double left, right;
  double operator()(double value) const {
    return left + (right - left) * (value - extent.low) / (extent.high - extent.low);
  }
};

std::string axis_svg(const Across& across, double bottom, const std::string& unit) {
  std::string svg;
  const double step = nice_step(across.extent.high - across.extent.low);
  for (double tick = std::ceil(across.extent.low / step) * step; tick <= across.extent.high; tick += step) {
    const double value = std::fabs(tick) < 1e-9 * step ? 0 : tick;
    svg += line_svg(across(value), kTop, across(value), bottom, "class=\"grid\"");
    svg += "<text x=\"" + coordinate(across(value)) + "\" y=\"" + coordinate(bottom + 14) +
           "\" text-anchor=\"middle\">" + rounded(value, 6) + "</text>";
  }
  return svg + "<text x=\"" + coordinate(across.right) + "\" y=\"" + coordinate(bottom + 27) +
         "\" text-anchor=\"end\">" + html_escape(unit) + "</text>";
}

std::string row_svg(const RangeRow& row, const Across& across, double y, const std::string& unit, int decimals) {
  const auto number = [&](double value) { return fixed_number(value, decimals) + (unit.empty() ? "" : " " + unit); };
  std::string tip = row.label + ": " + number(row.middle);
  if (row.range) tip += ", " + number(row.range->low) + " to " + number(row.range->high);
  std::string svg = "<g><title>" + html_escape(tip) + "</title><text x=\"" + coordinate(across.left - 8) + "\" y=\"" +
                    coordinate(y + 4) + "\" text-anchor=\"end\">" + html_escape(fitted(row.label)) + "</text>";
  const std::string stroke = "stroke=\"" + row.color + "\"";
  if (row.range)
    svg += line_svg(across(row.range->low), y, across(row.range->high), y,
                    stroke + " stroke-width=\"5\" opacity=\"0.35\"");
  for (const double value : row.points)
    svg += "<circle cx=\"" + coordinate(across(value)) + "\" cy=\"" + coordinate(y) + "\" r=\"2.6\" fill=\"" +
           row.color + "\" opacity=\"0.75\"/>";
  return svg + line_svg(across(row.middle), y - 7, across(row.middle), y + 7, stroke + " stroke-width=\"2.4\"") +
         "</g>\n";
}

std::optional<double> number_of_value(const std::string& json) {
  double number = 0;
  const char* const end = json.data() + json.size();
  const auto done = std::from_chars(json.data(), end, number);
  if (done.ec != std::errc() || done.ptr != end || !std::isfinite(number)) return std::nullopt;
  return number;
}

/// What a run has of all axes but one, for a legend.
std::string label_beside(SweepRun run, const std::string& key) {
  run.clip.clear();
  run.seed.clear();
  std::erase_if(run.values, [&key](const auto& value) { return value.first == key; });
  return sweep_label(run);
}

/// Which line is which, below a plot: where lines end is where they are close together.
std::string legend_of(const Plot& plot) {
  std::string text = "<p class=\"legend\">";
  for (const PlotLine& line : plot.lines)
    text += "<span><span class=\"box\" style=\"background:" + line.color + "\"></span>" + html_escape(line.label) +
            "</span>";
  return text + "</p>";
}

}  // namespace

std::string range_plot_svg(const std::string& title, const std::string& unit, const std::vector<RangeRow>& rows,
                           bool has_zero, int decimals) {
  if (rows.empty()) return "<p class=\"nothing\">nothing to plot</p>";
  std::size_t longest = 0;
  for (const RangeRow& row : rows) longest = std::max(longest, count_characters(row.label));
  const double left = std::min(kMostLabel, static_cast<double>(longest) * kLetter) + 14;
  const double bottom = kTop + kRow * static_cast<double>(rows.size());
  const Across across{extent_of(rows, has_zero), left, kWidth - kRight};
  std::string svg = "<svg class=\"plot\" role=\"img\" aria-label=\"" + html_escape(title) + "\" viewBox=\"0 0 " +
                    coordinate(kWidth) + " " + coordinate(bottom + kBottom) + "\">\n" + axis_svg(across, bottom, unit);
  if (has_zero) svg += line_svg(across(0), kTop, across(0), bottom, "class=\"axis\"");
  for (std::size_t i = 0; i < rows.size(); ++i)
    svg += row_svg(rows[i], across, kTop + kRow * (static_cast<double>(i) + 0.5), unit, decimals);
  return svg + "</svg>";
}

std::string mean_plot(const SweepResults& results, const MetricFacts& metric) {
  std::vector<RangeRow> rows;
  for (const SweepGroup& group : results.groups) {
    RangeRow row{group.label, {}, 0, std::nullopt, group.is_reference ? "var(--copy)" : "var(--result)"};
    for (const std::size_t i : group.rows) {
      if (const double* const value = find_metric(results.rows[i].values, metric.name)) row.points.push_back(*value);
    }
    const SampleStatistics mean = group_statistics(results, group, metric).sample;
    if (mean.count == 0) continue;
    row.middle = mean.mean;
    if (mean.count > 1) row.range = Interval{mean.mean - mean.deviation, mean.mean + mean.deviation};
    rows.push_back(std::move(row));
  }
  return rows.empty()
             ? ""
             : range_plot_svg(std::string(metric.label), std::string(metric.unit), rows, false, metric.decimals);
}

std::string difference_plot(const SweepResults& results, const MetricFacts& metric) {
  std::vector<RangeRow> rows;
  for (const SweepGroup& group : results.groups) {
    const auto paired = group.is_reference ? std::nullopt : paired_difference(results, group, metric);
    if (!paired) continue;
    const std::string color = !is_clear(*paired, metric)                    ? "var(--start)"
                              : paired->statistics.mean * metric.better > 0 ? "var(--good)"
                                                                            : "var(--bad)";
    rows.push_back({group.label, paired->differences, paired->statistics.mean, paired->interval, color});
  }
  return rows.empty()
             ? ""
             : range_plot_svg(std::string(metric.label), std::string(metric.unit), rows, true, metric.decimals);
}

std::vector<std::string> number_axes(const SweepPlan& plan) {
  std::map<std::string, std::set<double>> numbers;
  std::vector<std::string> keys;
  for (const SweepRun& run : plan.runs) {
    for (const auto& [key, value] : run.values) {
      const auto number = number_of_value(value);
      if (number && numbers[key].insert(*number).second && numbers[key].size() == 2) keys.push_back(key);
    }
  }
  return keys;
}

std::string axis_plot(const SweepResults& results, const std::string& key, const MetricFacts& metric) {
  std::vector<std::pair<std::string, std::vector<std::pair<double, double>>>> lines;
  for (const SweepGroup& group : results.groups) {
    const SweepRun& run = results.plan.runs[group.rows.front()];
    const auto has =
        std::find_if(run.values.begin(), run.values.end(), [&key](const auto& v) { return v.first == key; });
    const auto number = number_of_value(has == run.values.end() ? "" : has->second);
    const SampleStatistics mean = group_statistics(results, group, metric).sample;
    if (!number || mean.count == 0) continue;
    const std::string label = label_beside(run, key);
    auto line = std::find_if(lines.begin(), lines.end(), [&label](const auto& other) { return other.first == label; });
    if (line == lines.end()) line = lines.insert(lines.end(), {label, {}});
    line->second.emplace_back(*number, mean.mean);
  }
  std::erase_if(lines, [](const auto& line) { return line.second.size() < 2; });
  if (lines.empty()) return "";
  Plot plot;
  plot.title = std::string(metric.label);
  plot.x_label = key;
  plot.unit = std::string(metric.unit);
  plot.decimals = metric.decimals;
  plot.has_whole_x = false;
  for (auto& [label, points] : lines) {
    std::sort(points.begin(), points.end());
    PlotLine line{label, part_color(plot.lines.size()), points};
    line.has_dots = true;
    plot.lines.push_back(std::move(line));
  }
  return plot_svg(plot) + (lines.size() > 1 ? legend_of(plot) : "");
}

}  // namespace hsi4d
