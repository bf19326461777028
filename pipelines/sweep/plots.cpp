#include "pipelines/sweep/plots.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "core/text.h"
#include "pipelines/report/figure.h"
#include "pipelines/sweep/tables.h"

namespace hsi4d {
namespace {

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

}  // namespace

std::string range_plot_svg(const std::string& title, const std::string& unit, const std::vector<RangeRow>& rows,
                           bool has_zero, int decimals) {
  Plot plot{.title = title, .x_label = unit, .unit = unit, .series = {}, .begins_at_zero = has_zero, .width = 420};
  const auto number = [&](double value) { return fixed_number(value, decimals) + (unit.empty() ? "" : " " + unit); };
  for (const RangeRow& row : rows) {
    const auto y = static_cast<double>(plot.rows.size());
    plot.rows.push_back(row.label);
    Series series{.label = row.label + ": " + number(row.middle), .color = row.color, .points = {}};
    if (row.range) {
      series.label += ", " + number(row.range->low) + " to " + number(row.range->high);
      plot.series.push_back(series);
      plot.series.back().points = {{row.range->low, y}, {row.range->high, y}};
      plot.series.back().line = 5;
      plot.series.back().opacity = 0.35;
    }
    plot.series.push_back(series);
    plot.series.back().line = 0;
    plot.series.back().dots = 2.6;
    plot.series.back().opacity = 0.75;
    for (const double value : row.points) plot.series.back().points.emplace_back(value, y);
    series.points = {{row.middle, y - 0.35}, {row.middle, y + 0.35}};
    series.line = 2.4;
    plot.series.push_back(series);
  }
  return plot_svg(plot);
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
  Plot plot{.title = std::string(metric.label),
            .x_label = key,
            .unit = std::string(metric.unit),
            .series = {},
            .has_whole_x = false,
            .decimals = metric.decimals};
  for (auto& [label, points] : lines) {
    std::sort(points.begin(), points.end());
    const std::string color = part_color(plot.series.size());
    plot.series.push_back({.label = label, .color = color, .points = points, .dots = 3});
    if (lines.size() > 1) plot.legend.emplace_back(label, color);
  }
  return plot_svg(plot);
}

}  // namespace hsi4d
