// Plots of a sweep's results as SVG text, styled by the page of a report.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "pipelines/sweep/results.h"
#include "pipelines/sweep/search_results.h"

namespace hsi4d {

/// A row of a range plot: values, their middle and a range about it.
struct RangeRow {
  std::string label;
  std::vector<double> points;
  double middle = 0;
  std::optional<Interval> range;
  std::string color = "var(--result)";  ///< CSS, of this program's making
};

/// Rows below one another on one axis: a dot a value, a mark at the middle, a bar for the range.
/// @param has_zero  0 is on the axis, as a line
/// @param decimals  of tooltips
std::string range_plot_svg(const std::string& title, const std::string& unit, const std::vector<RangeRow>& rows,
                           bool has_zero, int decimals);

/// A metric of every group: its seeds, mean and standard deviation; empty where no group has it.
std::string mean_plot(const SweepResults& results, const MetricFacts& metric);

/// Differences of a metric: its pairs, mean and interval; empty where there are none.
std::string difference_plot(const SweepResults& results, const MetricFacts& metric);

/// A metric over the numbers of an axis, a line for each combination of all else; empty where there are not two.
std::string axis_plot(const SweepResults& results, const std::string& key, const MetricFacts& metric);

/// A column for each setting of a search and for the metric in each rung, a line for each point through its values: the
/// best one's is thick and blue, the last one's is orange. The best of the metric is at the top.
std::string parallel_plot(const SearchResults& found);

/// How much each setting of a search matters to a metric: a bar, in colour where it is more than the mark, which chance
/// rarely passes. Empty where there are too few points.
std::string importance_plot(const SweepResults& results, const SearchResults& found, const MetricFacts& metric);

/// The search's metric in the first rung over a setting that is a number: a dot a point. Empty for others.
std::string setting_plot(const SearchResults& found, std::size_t key);

/// Keys of axes with at least two numbers, but those of searches.
std::vector<std::string> number_axes(const SweepPlan& plan);

}  // namespace hsi4d
