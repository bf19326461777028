#include "pipelines/sweep/results.h"

#include <algorithm>
#include <fstream>
#include <map>
#include <set>
#include <string_view>

#include "core/file.h"
#include "pipelines/sweep/halving.h"

namespace hsi4d {
namespace {

bool is_repetition(const SweepRun& a, const SweepRun& b) {
  return a.block == b.block && a.ablation == b.ablation && a.values == b.values;
}

/// The value of a run on an axis that runs are compared by; null: it has none.
const std::string* find_value(const SweepRun& run, const std::string& axis) {
  if (axis == "ablation") return run.ablation.empty() ? nullptr : &run.ablation;
  if (axis == "block") return run.block.empty() ? nullptr : &run.block;
  for (const auto& [key, value] : run.values) {
    if (key == axis) return &value;
  }
  return nullptr;
}

bool is_compared_by(const SweepPlan& plan, const std::string& axis) {
  return std::any_of(plan.compare.begin(), plan.compare.end(),
                     [&axis](const auto& wanted) { return wanted.first == axis; });
}

/// Whether others are compared with this run.
bool is_reference(const SweepPlan& plan, const SweepRun& run) {
  return std::all_of(plan.compare.begin(), plan.compare.end(), [&run](const auto& wanted) {
    const std::string* const value = find_value(run, wanted.first);
    return value != nullptr && *value == wanted.second;
  });
}

bool is_partner(const SweepPlan& plan, const SweepRun& run, const SweepRun& other) {
  if (other.clip != run.clip || other.seed != run.seed || !is_reference(plan, other)) return false;
  if (!other.ablation.empty() && !is_compared_by(plan, "ablation") && other.ablation != run.ablation) return false;
  return std::all_of(other.values.begin(), other.values.end(), [&](const auto& value) {
    if (is_compared_by(plan, value.first)) return true;
    const std::string* const own = find_value(run, value.first);
    return own != nullptr && *own == value.second;
  });
}

constexpr const char* kLostText =
    "its process ended without a word: it was killed, for want of memory perhaps, or its machine is gone";

/// What a log warns of, each once.
std::vector<std::string> warnings_of(const std::string& log) {
  constexpr std::string_view kWarning = " warning ";
  std::vector<std::string> warnings;
  std::ifstream lines(log);
  for (std::string line; std::getline(lines, line);) {
    const std::size_t level = line.find(' ');  // after the time
    if (level == std::string::npos || line.compare(level, kWarning.size(), kWarning) != 0) continue;
    std::string text = line.substr(level + kWarning.size());
    if (std::find(warnings.begin(), warnings.end(), text) == warnings.end()) warnings.push_back(std::move(text));
  }
  return warnings;
}

SweepRow read_row(const SweepPaths& paths, std::size_t index, const SweepRun& run, SweepRunState state) {
  SweepRow row;
  row.index = index;
  row.state = state;
  std::set<std::string> programs;
  for (SweepAttempt& attempt : read_attempts(paths, run.id)) {
    row.starts += attempt.event == "start" ? 1 : 0;
    if (attempt.event == "start") programs.insert(attempt.program.hash);
    row.peak_mb = std::max(row.peak_mb, attempt.peak_mb);
    row.last = std::move(attempt);
  }
  row.programs = programs.size();
  if (row.state == SweepRunState::kStarted && row.last && row.last->event == "start" && !is_claimed(paths, run.id))
    row.last->message = kLostText;
  row.warnings = warnings_of(RunPaths{paths.run(run.id)}.log());
  if (row.state != SweepRunState::kDone) return row;
  const std::string file = RunPaths{paths.run(run.id)}.summary();
  const RunSummary summary = parse_summary(read_text_file(file), file);
  for (const auto& [name, value] : summary.metrics.back().values) {
    if (find_metric_facts(name) != nullptr) row.values.emplace_back(name, value);
  }
  if (!summary.quality.empty())
    row.values.emplace_back(gates_facts().name, static_cast<double>(passed_count(summary.quality)) /
                                                    static_cast<double>(summary.quality.size()));
  row.values.emplace_back(seconds_facts().name, summary.seconds);
  return row;
}

std::vector<SweepGroup> groups_of(const SweepPlan& plan) {
  std::vector<SweepGroup> groups;
  for (std::size_t i = 0; i < plan.runs.size(); ++i) {
    const auto like = [&](const SweepGroup& group) {
      return is_repetition(plan.runs[group.rows.front()], plan.runs[i]);
    };
    auto group = std::find_if(groups.begin(), groups.end(), like);
    if (group == groups.end()) {
      const bool is_compared_with = !plan.compare.empty() && is_reference(plan, plan.runs[i]);
      groups.push_back({sweep_label(without_repetition(plan.runs[i])), {}, is_compared_with});
      group = groups.end() - 1;
    }
    const auto is_same = [&](std::size_t row) { return plan.runs[row].id == plan.runs[i].id; };
    if (std::none_of(group->rows.begin(), group->rows.end(), is_same)) group->rows.push_back(i);
  }
  if (groups.size() == 1) groups.front().label = "all runs";
  return groups;
}

std::vector<const MetricFacts*> metrics_of(const std::vector<SweepRow>& rows) {
  std::vector<const MetricFacts*> metrics;
  const auto add = [&](const MetricFacts& facts) {
    if (std::any_of(rows.begin(), rows.end(),
                    [&](const SweepRow& row) { return find_metric(row.values, facts.name) != nullptr; }))
      metrics.push_back(&facts);
  };
  for (const MetricFacts& facts : metric_facts()) add(facts);
  add(gates_facts());
  add(seconds_facts());
  return metrics;
}

}  // namespace

std::size_t SweepResults::count(SweepRunState state) const {
  return static_cast<std::size_t>(
      std::count_if(rows.begin(), rows.end(), [state](const SweepRow& row) { return row.state == state; }));
}

const MetricFacts& gates_facts() {
  static const MetricFacts facts{"gates_passed", "quality gates", "", "Share of the quality gates that pass", 2, 1};
  return facts;
}

const MetricFacts& seconds_facts() {
  static const MetricFacts facts{
      "seconds", "time", "s", "Time of reconstructing on the clock, without reading the inputs, preview and report",
      1,         -1};
  return facts;
}

SweepResults sweep_results_of(SweepPlan plan, std::vector<SweepRow> rows) {
  SweepResults results;
  for (const SweepRun& run : plan.runs) {
    if (std::find(results.clips.begin(), results.clips.end(), run.clip) == results.clips.end())
      results.clips.push_back(run.clip);
  }
  results.groups = groups_of(plan);
  std::erase_if(results.groups, [&rows](const SweepGroup& group) {
    return std::all_of(group.rows.begin(), group.rows.end(),
                       [&rows](std::size_t row) { return rows[row].state == SweepRunState::kLeftOut; });
  });
  results.metrics = metrics_of(rows);
  results.plan = std::move(plan);
  results.rows = std::move(rows);
  return results;
}

SweepResults read_sweep_results(const SweepPaths& paths) {
  SweepPlan plan = read_sweep_plan(paths);
  std::vector<SweepRow> rows;
  const std::vector<SweepRunState> states = sweep_run_states(paths, plan);
  for (std::size_t i = 0; i < plan.runs.size(); ++i) rows.push_back(read_row(paths, i, plan.runs[i], states[i]));
  return sweep_results_of(std::move(plan), std::move(rows));
}

GroupStatistics group_statistics(const SweepResults& results, const SweepGroup& group, const MetricFacts& metric,
                                 const std::string* clip) {
  std::set<std::string> clips;
  std::map<std::string, std::map<std::string, double>> values;  // of seeds, of clips
  for (const std::size_t i : group.rows) {
    const SweepRun& run = results.plan.runs[i];
    if (clip != nullptr && run.clip != *clip) continue;
    clips.insert(run.clip);
    if (const double* const value = find_metric(results.rows[i].values, metric.name))
      values[run.seed].emplace(run.clip, *value);
  }
  GroupStatistics statistics;
  std::vector<double> means;
  for (const auto& [seed, of_clips] : values) {
    if (of_clips.size() != clips.size()) continue;
    double sum = 0;
    for (const auto& [name, value] : of_clips) {
      sum += value;
      statistics.clip_seeds.emplace_back(name, seed);
    }
    means.push_back(sum / static_cast<double>(clips.size()));
  }
  statistics.sample = sample_statistics(means);
  std::sort(statistics.clip_seeds.begin(), statistics.clip_seeds.end());
  return statistics;
}

std::optional<std::size_t> partner_of(const SweepPlan& plan, std::size_t index) {
  const SweepRun& run = plan.runs[index];
  if (plan.compare.empty() || is_reference(plan, run)) return std::nullopt;
  std::optional<std::size_t> found;
  for (std::size_t i = 0; i < plan.runs.size(); ++i) {
    if (!is_partner(plan, run, plan.runs[i])) continue;
    if (plan.runs[i].block == run.block) return i;
    if (!found) found = i;
  }
  return found;
}

std::optional<PairedDifference> paired_difference(const SweepResults& results, const SweepGroup& group,
                                                  const MetricFacts& metric) {
  PairedDifference paired;
  for (const std::size_t i : group.rows) {
    const std::optional<std::size_t> partner = partner_of(results.plan, i);
    if (!partner) continue;
    const double* const value = find_metric(results.rows[i].values, metric.name);
    const double* const other = find_metric(results.rows[*partner].values, metric.name);
    if (value != nullptr && other != nullptr) paired.differences.push_back(*value - *other);
  }
  if (paired.differences.empty()) return std::nullopt;
  paired.statistics = sample_statistics(paired.differences);
  paired.interval = bootstrap_interval(paired.differences);
  return paired;
}

}  // namespace hsi4d
