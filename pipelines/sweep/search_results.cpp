#include "pipelines/sweep/search_results.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <set>

#include "core/random.h"
#include "core/text.h"
#include "pipelines/sweep/selection.h"

namespace hsi4d {
namespace {

constexpr std::size_t kMostGroups = 5, kFewestInGroup = 5;
constexpr int kOrders = 200;
constexpr double kChance = 0.95;

const std::string& searched_value(const SweepRun& run, const std::string& key) {
  static const std::string none;
  for (const auto& [own, value] : run.values) {
    if (own == key) return value;
  }
  return none;
}

/// The median of a metric over runs; nothing unless all of them have it.
std::optional<double> median_over(const SweepResults& results, const std::vector<std::size_t>& runs,
                                  std::string_view metric) {
  std::vector<double> values;
  for (const std::size_t run : runs) {
    if (const double* const value = find_metric(results.rows[run].values, metric)) values.push_back(*value);
  }
  if (values.empty() || values.size() < runs.size()) return std::nullopt;
  std::sort(values.begin(), values.end());
  return quantile(values, 0.5);
}

/// The place of each number among them, from 0; equal ones have the mean of theirs.
std::vector<double> ranks_of(const std::vector<double>& values) {
  std::vector<double> sorted = values, ranks;
  std::sort(sorted.begin(), sorted.end());
  for (const double value : values) {
    const auto [first, last] = std::equal_range(sorted.begin(), sorted.end(), value);
    ranks.push_back((static_cast<double>(first - sorted.begin()) + static_cast<double>(last - sorted.begin()) - 1) / 2);
  }
  return ranks;
}

/// Which group each value is of.
std::vector<std::size_t> value_groups(const std::vector<std::string>& values) {
  std::map<std::string, std::size_t> distinct;
  std::vector<double> numbers;
  for (const std::string& value : values) {
    distinct.emplace(value, distinct.size());
    if (const auto number = number_in(value)) numbers.push_back(*number);
  }
  std::vector<std::size_t> groups;
  if (distinct.size() <= kMostGroups || numbers.size() < values.size()) {
    for (const std::string& value : values) groups.push_back(distinct[value]);
    return groups;
  }
  const std::size_t count = std::clamp(values.size() / kFewestInGroup, std::size_t{2}, kMostGroups);
  for (const double rank : ranks_of(numbers))
    groups.push_back(
        static_cast<std::size_t>((rank + 0.5) * static_cast<double>(count) / static_cast<double>(values.size())));
  return groups;
}

/// Σ (r − mean)² within groups.
double squares_within(const std::vector<double>& ranks, const std::vector<std::size_t>& groups) {
  std::map<std::size_t, std::vector<double>> of_group;
  for (std::size_t i = 0; i < ranks.size(); ++i) of_group[groups[i]].push_back(ranks[i]);
  double squares = 0;
  for (const auto& [group, own] : of_group) {
    const SampleStatistics sample = sample_statistics(own);
    squares += sample.deviation * sample.deviation * static_cast<double>(own.size() - 1);
  }
  return squares;
}

double correlation_of(const std::vector<double>& a, const std::vector<double>& b) {
  const SampleStatistics of_a = sample_statistics(a), of_b = sample_statistics(b);
  if (of_a.deviation == 0 || of_b.deviation == 0) return 0;
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - of_a.mean) * (b[i] - of_b.mean);
  return sum / (static_cast<double>(a.size() - 1) * of_a.deviation * of_b.deviation);
}

}  // namespace

std::optional<double> number_in(const std::string& json) {
  double number = 0;
  const char* const end = json.data() + json.size();
  const auto done = std::from_chars(json.data(), end, number);
  if (done.ec != std::errc() || done.ptr != end || !std::isfinite(number)) return std::nullopt;
  return number;
}

std::size_t SearchedPoint::rung() const {
  std::size_t highest = 0;
  for (std::size_t i = 0; i < scores.size(); ++i) {
    if (scores[i]) highest = i;
  }
  return highest;
}

std::vector<SearchResults> search_results(const SweepResults& results) {
  std::vector<SearchResults> all;
  std::map<std::string, std::size_t> place_of;                      // by what else its runs have in common
  std::map<std::string, std::map<std::string, std::size_t>> known;  // points of these
  for (std::size_t i = 0; i < results.plan.runs.size(); ++i) {
    const SweepRun& run = results.plan.runs[i];
    const PlannedSearch* const search = search_of(results.plan, run);
    if (search == nullptr) continue;
    std::set<std::string> own = {"clip", "seed"};
    own.insert(search->rung_keys.begin(), search->rung_keys.end());
    std::string point;
    std::vector<std::string> values;
    for (const SearchedKey& key : search->over) {
      own.insert(key.key);
      values.push_back(searched_value(run, key.key));
      point += values.back() + "\n";
    }
    const std::string label = name_without_axes(run, own);
    const auto [place, is_new] = place_of.emplace(label, all.size());
    if (is_new) all.push_back({search, label, {}});
    SearchResults& found = all[place->second];
    found.rungs = std::max(found.rungs, run.rung + 1);
    const auto [at, is_new_point] = known[label].emplace(point, found.points.size());
    if (is_new_point) found.points.push_back({std::move(values), {}, {}});
    auto& runs = found.points[at->second].runs;
    if (runs.size() <= run.rung) runs.resize(run.rung + 1);
    runs[run.rung].push_back(i);
  }
  for (SearchResults& found : all) {
    for (SearchedPoint& point : found.points) {
      point.runs.resize(found.rungs);
      for (const auto& runs : point.runs) point.scores.push_back(median_over(results, runs, found.search->metric));
    }
    std::erase_if(found.points, [](const SearchedPoint& point) { return !point.scores[point.rung()]; });
    const int better = find_metric_facts(found.search->metric)->better;
    std::stable_sort(found.points.begin(), found.points.end(),
                     [better](const SearchedPoint& a, const SearchedPoint& b) {
                       if (a.rung() != b.rung()) return a.rung() > b.rung();
                       return *a.scores[a.rung()] * better > *b.scores[b.rung()] * better;
                     });
  }
  std::erase_if(all, [](const SearchResults& found) { return found.points.empty(); });
  return all;
}

Table best_points_table(const SearchResults& found) {
  constexpr std::size_t kMost = 10;
  const MetricFacts& facts = *find_metric_facts(found.search->metric);
  Table table{.title = "Best of the search" + (found.label.empty() ? "" : ", " + found.label), .head = {""}};
  table.caption = "Of " + std::to_string(found.points.size()) + " points the best by " + std::string(facts.label) +
                  ", the median over clips and seeds" +
                  (found.rungs > 1 ? "; those that have come to a higher rung first" : "");
  std::vector<std::string> keys;
  for (const SearchedKey& key : found.search->over) keys.push_back(key.key);
  for (const std::string& name : short_sweep_keys(keys, 2)) table.head.emplace_back(name);
  for (std::size_t rung = found.rungs; rung-- > 0;)
    table.head.emplace_back(metric_heading(facts) + (found.rungs > 1 ? ", rung " + std::to_string(rung + 1) : ""));
  for (std::size_t i = 0; i < std::min(kMost, found.points.size()); ++i) {
    const SearchedPoint& point = found.points[i];
    std::vector<Cell> cells = {std::to_string(i + 1)};
    for (const std::string& value : point.values) cells.emplace_back(plain_sweep_value(value));
    for (std::size_t rung = found.rungs; rung-- > 0;)
      cells.push_back(point.scores[rung] ? Cell(*point.scores[rung], facts.decimals) : Cell());
    table.rows.push_back(std::move(cells));
  }
  return table;
}

std::optional<Importance> importance_of(const std::vector<std::string>& values, const std::vector<double>& scores) {
  const std::size_t n = scores.size();
  if (n < kFewestPoints) return std::nullopt;
  std::vector<double> ranks = ranks_of(scores);
  const std::vector<std::size_t> groups = value_groups(values);
  const std::size_t count = std::set<std::size_t>(groups.begin(), groups.end()).size();
  const double whole = squares_within(ranks, std::vector<std::size_t>(n));
  const auto [least, most] = std::minmax_element(ranks.begin(), ranks.end());
  if (count < 2 || count == n || *least == *most) return std::nullopt;
  const double scale = static_cast<double>(n - 1) / static_cast<double>(n - count) / whole;
  const auto share = [&] { return 1 - scale * squares_within(ranks, groups); };
  Importance importance{share(), 0, 0};
  std::vector<double> numbers;
  for (const std::string& value : values) {
    if (const auto number = number_in(value)) numbers.push_back(*number);
  }
  if (numbers.size() == n) importance.correlation = correlation_of(ranks_of(numbers), ranks);
  RandomSequence random(0, random_stream("sweep.importance"));
  std::vector<double> by_chance;
  for (int i = 0; i < kOrders; ++i) {
    for (std::size_t j = n - 1; j > 0; --j) std::swap(ranks[j], ranks[random.below(j + 1)]);
    by_chance.push_back(share());
  }
  std::sort(by_chance.begin(), by_chance.end());
  importance.chance = quantile(by_chance, kChance);
  return importance;
}

std::vector<std::optional<Importance>> importances(const SweepResults& results, const SearchResults& found,
                                                   const MetricFacts& metric) {
  std::vector<double> scores;
  std::vector<const SearchedPoint*> points;
  for (const SearchedPoint& point : found.points) {
    const auto score = median_over(results, point.runs.front(), metric.name);
    if (!score) continue;
    scores.push_back(*score);
    points.push_back(&point);
  }
  std::vector<std::optional<Importance>> all;
  for (std::size_t key = 0; key < found.search->over.size(); ++key) {
    std::vector<std::string> values;
    for (const SearchedPoint* const point : points) values.push_back(point->values[key]);
    all.push_back(importance_of(values, scores));
  }
  return all;
}

}  // namespace hsi4d
