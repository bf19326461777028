#include "pipelines/sweep/plots.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "core/text.h"
#include "pipelines/report/figure.h"
#include "pipelines/sweep/tables.h"

namespace hsi4d {
namespace {

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

namespace {

/// Where the values of a column stand, from 0 at the bottom to 1.
struct Column {
  std::string name;
  std::vector<double> places;                           ///< of each point; NaN: it has none
  std::vector<std::pair<double, std::string>> marks{};  ///< place, text
};

/// Numbers between their least and largest, above 0 on a logarithmic scale.
/// @param better  −1: the least is at the top
Column number_column(const std::string& name, const std::vector<double>& numbers, bool is_log, int better) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const double number : numbers) {
    if (std::isnan(number)) continue;
    low = std::min(low, number);
    high = std::max(high, number);
  }
  const auto scaled = [is_log](double number) { return is_log ? std::log(number) : number; };
  const double span = scaled(high) - scaled(low);
  const auto place = [&](double number) {
    const double share = span > 0 ? (scaled(number) - scaled(low)) / span : 0.5;
    return better < 0 ? 1 - share : share;
  };
  Column column{name, {}};
  for (const double number : numbers) column.places.push_back(place(number));
  const double middle = is_log ? std::sqrt(low * high) : low + (high - low) / 2;
  for (const double number : span > 0 ? std::vector{low, middle, high} : std::vector{low})
    column.marks.emplace_back(place(number), rounded(number, 3));
  return column;
}

/// Words below one another.
Column word_column(const std::string& name, const std::vector<std::string>& words) {
  const std::set<std::string> sorted(words.begin(), words.end());
  const std::vector<std::string> all(sorted.begin(), sorted.end());
  const auto place = [&all](std::size_t i) {
    return 1 - (static_cast<double>(i) + 0.5) / static_cast<double>(all.size());
  };
  Column column{name, {}};
  for (const std::string& word : words)
    column.places.push_back(place(static_cast<std::size_t>(std::find(all.begin(), all.end(), word) - all.begin())));
  for (std::size_t i = 0; i < all.size(); ++i)
    column.marks.emplace_back(place(i), shortened(plain_sweep_value(all[i]), 14));
  return column;
}

/// From the best point's colour to the last one's, by way of grey.
std::string rank_color(std::size_t rank, std::size_t count) {
  constexpr int kColors[3][3] = {{0x1f, 0x6f, 0xc8}, {0x9a, 0xa3, 0xae}, {0xd9, 0x8a, 0x2b}};
  const double at = count > 1 ? 2.0 * static_cast<double>(rank) / static_cast<double>(count - 1) : 0;
  const int first = at < 1 ? 0 : 1;
  const auto mixed = [&](int c) {
    return static_cast<int>(
        std::lround(kColors[first][c] + (at - first) * (kColors[first + 1][c] - kColors[first][c])));
  };
  return formatted("#%02x%02x%02x", mixed(0), mixed(1), mixed(2));
}

std::vector<std::string> searched_names(const SearchResults& found) {
  std::vector<std::string> keys;
  for (const SearchedKey& key : found.search->over) keys.push_back(key.key);
  return short_sweep_keys(keys, 2);
}

/// True for errors of which some are so large that the others would be as one on a linear scale.
bool is_spread(const SearchResults& found, const MetricFacts& facts) {
  constexpr double kLargestRatio = 4;
  double low = std::numeric_limits<double>::infinity(), high = 0;
  for (const SearchedPoint& point : found.points) {
    for (const auto& score : point.scores) {
      if (!score) continue;
      low = std::min(low, *score);
      high = std::max(high, *score);
    }
  }
  return facts.better < 0 && low > 0 && high > kLargestRatio * low;
}

std::vector<Column> columns_of(const SearchResults& found) {
  const MetricFacts& facts = *find_metric_facts(found.search->metric);
  const std::vector<std::string> names = searched_names(found);
  std::vector<Column> columns;
  for (std::size_t key = 0; key < names.size(); ++key) {
    std::vector<std::string> words;
    std::vector<double> numbers;
    for (const SearchedPoint& point : found.points) {
      words.push_back(point.values[key]);
      if (const auto number = number_in(words.back())) numbers.push_back(*number);
    }
    columns.push_back(numbers.size() == words.size()
                          ? number_column(names[key], numbers, found.search->over[key].is_log, 1)
                          : word_column(names[key], words));
  }
  for (std::size_t rung = 0; rung < found.rungs; ++rung) {
    std::vector<double> scores;
    for (const SearchedPoint& point : found.points)
      scores.push_back(point.scores[rung].value_or(std::numeric_limits<double>::quiet_NaN()));
    if (std::all_of(scores.begin(), scores.end(), [](double score) { return std::isnan(score); })) continue;
    const std::string name = found.rungs > 1 ? "rung " + std::to_string(rung + 1) : "";
    const std::string metric = found.rungs > 1 ? std::string(facts.label) + ", " : shown_metric(facts);
    columns.push_back(number_column((rung == 0 ? metric : "") + name, scores, is_spread(found, facts), facts.better));
  }
  return columns;
}

std::string point_text(const SearchResults& found, const SearchedPoint& point) {
  const MetricFacts& facts = *find_metric_facts(found.search->metric);
  const std::vector<std::string> names = searched_names(found);
  std::string text;
  for (std::size_t key = 0; key < names.size(); ++key)
    text += names[key] + " " + plain_sweep_value(point.values[key]) + ", ";
  return text + std::string(facts.label) + " " + fixed_number(*point.scores[point.rung()], facts.decimals);
}

}  // namespace

std::string parallel_plot(const SearchResults& found) {
  const std::vector<Column> columns = columns_of(found);
  Plot plot{.title = std::string(find_metric_facts(found.search->metric)->label) + " by the settings searched",
            .x_label = "",
            .unit = "",
            .series = {},
            .width = std::max(900.0, 130.0 * static_cast<double>(columns.size())),
            .height = 300};
  for (const Column& column : columns) plot.columns.push_back(column.name);
  for (std::size_t i = found.points.size(); i-- > 0;) {  // the best one on top
    Series line{.label = point_text(found, found.points[i]), .color = rank_color(i, found.points.size()), .points = {}};
    for (std::size_t c = 0; c < columns.size(); ++c) {
      if (!std::isnan(columns[c].places[i])) line.points.emplace_back(static_cast<double>(c), columns[c].places[i]);
    }
    line.line = i == 0 ? 3.2 : 1.5;
    line.opacity = i == 0 ? 1 : 0.75;
    plot.series.push_back(std::move(line));
  }
  for (std::size_t c = 0; c < columns.size(); ++c) {
    for (const auto& [place, text] : columns[c].marks)
      plot.series.push_back({.label = text,
                             .color = "",
                             .points = {{static_cast<double>(c), place}},
                             .line = 0,
                             .name = place > 0.5 ? Series::Name::kAbove : Series::Name::kBelow});
  }
  return plot_svg(plot);
}

std::string importance_plot(const SweepResults& results, const SearchResults& found, const MetricFacts& metric) {
  const std::vector<std::optional<Importance>> all = importances(results, found, metric);
  const std::vector<std::string> names = searched_names(found);
  std::vector<std::size_t> order;
  for (std::size_t key = 0; key < all.size(); ++key) {
    if (all[key]) order.push_back(key);
  }
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return all[a]->share > all[b]->share; });
  if (order.empty()) return "";
  Plot plot{.title = std::string(metric.label) + ": what matters",
            .x_label = "share of the variance of its ranks, %",
            .unit = "%",
            .series = {},
            .begins_at_zero = true,
            .also = {100},
            .width = 420};
  for (const std::size_t key : order) {
    const Importance& own = *all[key];
    const auto y = static_cast<double>(plot.rows.size());
    plot.rows.push_back(names[key]);
    const bool is_clear = own.share > own.chance;
    const std::string label = names[key] + ": " + fixed_number(100 * own.share, 0) + " %, by chance up to " +
                              fixed_number(100 * own.chance, 0) + " %; correlation of ranks " +
                              fixed_number(own.correlation, 2);
    plot.series.push_back({.label = label,
                           .color = is_clear ? "var(--result)" : "var(--start)",
                           .points = {{0, y}, {100 * std::max(own.share, 0.0), y}},
                           .line = 12,
                           .opacity = is_clear ? 1 : 0.5});
    plot.series.push_back({.label = label,
                           .color = "var(--text)",
                           .points = {{100 * own.chance, y - 0.38}, {100 * own.chance, y + 0.38}},
                           .line = 1.6});
  }
  return plot_svg(plot);
}

std::string setting_plot(const SearchResults& found, std::size_t key) {
  const MetricFacts& facts = *find_metric_facts(found.search->metric);
  Plot plot{.title = std::string(facts.label),
            .x_label = searched_names(found)[key],
            .unit = std::string(facts.unit),
            .series = {},
            .is_log = is_spread(found, facts),
            .is_log_x = found.search->over[key].is_log,
            .has_whole_x = false,
            .decimals = facts.decimals};
  for (std::size_t i = found.points.size(); i-- > 0;) {
    const SearchedPoint& point = found.points[i];
    const auto number = number_in(point.values[key]);
    if (!number || !point.scores.front()) continue;
    plot.series.push_back({.label = "point " + std::to_string(i + 1),
                           .color = rank_color(i, found.points.size()),
                           .points = {{*number, *point.scores.front()}},
                           .line = 0,
                           .dots = i == 0 ? 5.0 : 3.5});
  }
  return plot.series.empty() ? "" : plot_svg(plot);
}

std::vector<std::string> number_axes(const SweepPlan& plan) {
  std::map<std::string, std::set<double>> numbers;
  std::vector<std::string> keys;
  for (const SweepRun& run : plan.runs) {
    if (search_of(plan, run) != nullptr) continue;  // whose plots are their own
    for (const auto& [key, value] : run.values) {
      const auto number = number_in(value);
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
    const auto number = number_in(has == run.values.end() ? "" : has->second);
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
