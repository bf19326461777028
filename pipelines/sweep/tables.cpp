#include "pipelines/sweep/tables.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "core/text.h"
#include "pipelines/sweep/search_results.h"

namespace hsi4d {
namespace {

std::string with_sign(const std::string& number) {
  if (number.find_first_of("123456789") == std::string::npos) return number;
  if (number.starts_with("-")) return "−" + number.substr(1);
  return "+" + number;
}

/// "31.2 ± 0.4".
std::string mean_text(const SampleStatistics& sample, const MetricFacts& facts) {
  if (sample.count == 0) return "";
  const std::string mean = fixed_number(sample.mean, facts.decimals);
  return sample.count > 1 ? mean + " ± " + fixed_number(sample.deviation, facts.decimals) : mean;
}

/// "+1.2 [+0.3, +2.1]".
std::string difference_text(const PairedDifference& paired, const MetricFacts& facts) {
  const auto number = [&facts](double value) { return with_sign(fixed_number(value, facts.decimals)); };
  if (!paired.interval) return number(paired.statistics.mean);
  return number(paired.statistics.mean) + " [" + number(paired.interval->low) + ", " + number(paired.interval->high) +
         "]";
}

std::string mark_of(const PairedDifference& paired, const MetricFacts& facts) {
  if (!is_clear(paired, facts)) return "";
  return paired.statistics.mean * facts.better > 0 ? "better" : "worse";
}

/// The rows whose means are of the same clips and seeds, of which there are the most: only these can be compared.
std::vector<std::size_t> comparable_rows(const std::vector<GroupStatistics>& means) {
  std::map<std::vector<std::pair<std::string, std::string>>, std::vector<std::size_t>> rows;
  for (std::size_t row = 0; row < means.size(); ++row) {
    if (means[row].sample.count > 0) rows[means[row].clip_seeds].push_back(row);
  }
  std::vector<std::size_t> most;
  for (const auto& [runs, of_these] : rows) {
    const bool has_more = of_these.size() > most.size();
    const bool is_larger = of_these.size() == most.size() && runs.size() > means[most.front()].clip_seeds.size();
    if (has_more || is_larger) most = of_these;
  }
  return most;
}

/// "3", or "2 to 3" where not all metrics have the same.
std::string count_range(const std::set<std::size_t>& counts) {
  if (counts.empty()) return "";
  const std::string most = std::to_string(*counts.rbegin());
  return counts.size() == 1 ? most : std::to_string(*counts.begin()) + " to " + most;
}

/// How many seeds, and clips, the means of a row are of.
struct RowCounts {
  std::set<std::size_t> seeds, clips;

  void add(const GroupStatistics& mean) {
    if (mean.sample.count == 0) return;
    seeds.insert(mean.sample.count);
    clips.insert(mean.clip_seeds.size() / mean.sample.count);
  }
};

/// The keys that runs have values of, in order.
std::vector<std::string> value_keys(const SweepPlan& plan) {
  std::vector<std::string> keys;
  for (const SweepRun& run : plan.runs) {
    for (const auto& [key, value] : run.values) {
      if (std::find(keys.begin(), keys.end(), key) == keys.end()) keys.push_back(key);
    }
  }
  return keys;
}

}  // namespace

bool is_clear(const PairedDifference& paired, const MetricFacts& metric) {
  return metric.better != 0 && paired.differences.size() >= kFewestPairs && paired.interval &&
         !paired.interval->contains(0);
}

std::string reference_text(const SweepPlan& plan) {
  SweepRun run;
  for (const auto& [key, value] : plan.compare) {
    if (key == "ablation") run.ablation = value;
    if (key == "block") run.block = value;
    if (key != "ablation" && key != "block") run.values.emplace_back(key, value);
  }
  return plan.compare.empty() ? "" : sweep_label(run);
}

std::string progress_text(const SweepResults& results) {
  std::string text = std::to_string(results.rows.size()) + (results.rows.size() == 1 ? " run: " : " runs: ");
  bool is_first = true;
  for (const SweepRunState state : {SweepRunState::kDone, SweepRunState::kFailed, SweepRunState::kStarted,
                                    SweepRunState::kNew, SweepRunState::kLeftOut}) {
    const std::size_t count = results.count(state);
    if (count == 0) continue;
    text += (is_first ? "" : ", ") + std::to_string(count) + " " + std::string(sweep_run_state_name(state));
    is_first = false;
  }
  return text;
}

Table mean_table(const SweepResults& results, const std::string* clip) {
  const bool has_clips = clip == nullptr && results.clips.size() > 1;
  Table table{.title = clip == nullptr ? "Means" : *clip, .head = {"", "seeds"}};
  table.caption = std::string("Mean ± standard deviation over the seeds") +
                  (has_clips ? "; of each seed the mean over the clips, where all of them are done" : "") +
                  "; the best is marked of rows that are of the same clips and seeds";
  if (has_clips) table.head.emplace_back("clips");
  const std::size_t counts_end = table.head.size();
  for (const MetricFacts* const facts : results.metrics) table.head.emplace_back(metric_heading(*facts));
  for (const SweepGroup& group : results.groups) {
    table.rows.emplace_back(table.head.size());
    table.rows.back()[0] = group.label;
  }
  std::vector<RowCounts> counts(table.rows.size());
  for (std::size_t m = 0; m < results.metrics.size(); ++m) {
    const MetricFacts& facts = *results.metrics[m];
    std::vector<GroupStatistics> means;
    for (const SweepGroup& group : results.groups) means.push_back(group_statistics(results, group, facts, clip));
    for (std::size_t row = 0; row < means.size(); ++row) {
      table.rows[row][counts_end + m] = mean_text(means[row].sample, facts);
      counts[row].add(means[row]);
    }
    std::vector<Cell*> comparable;
    for (const std::size_t row : comparable_rows(means)) comparable.push_back(&table.rows[row][counts_end + m]);
    mark_best(facts.better, comparable);
  }
  for (std::size_t row = 0; row < counts.size(); ++row) {
    table.rows[row][1] = count_range(counts[row].seeds);
    if (has_clips) table.rows[row][2] = count_range(counts[row].clips);
  }
  if (clip != nullptr)  // groups that do not have this clip
    std::erase_if(table.rows, [](const std::vector<Cell>& row) { return row[1].text.empty(); });
  return table;
}

Table difference_table(const SweepResults& results) {
  Table table{.title = "Differences to " + reference_text(results.plan), .head = {"", "pairs"}};
  table.caption =
      "Run by run with the same clip and seed: mean [95 % interval of the mean by the bootstrap, 10,000 samples]; "
      "marked where the interval does not contain 0 and there are at least " +
      std::to_string(kFewestPairs) + " pairs";
  for (const MetricFacts* const metric : results.metrics) table.head.emplace_back(metric_heading(*metric));
  for (const SweepGroup& group : results.groups) {
    if (group.is_reference) continue;
    std::vector<Cell> row = {group.label, ""};
    std::set<std::size_t> pairs;
    for (const MetricFacts* const metric : results.metrics) {
      const auto paired = paired_difference(results, group, *metric);
      row.push_back(paired ? Cell(difference_text(*paired, *metric), mark_of(*paired, *metric)) : Cell());
      if (paired) pairs.insert(paired->statistics.count);
    }
    if (pairs.empty()) continue;
    row[1] = count_range(pairs);
    table.rows.push_back(std::move(row));
  }
  return table;
}

std::string unfinished_text(const SweepResults& results) {
  std::string text;
  for (const SweepRow& row : results.rows) {
    if (row.state == SweepRunState::kDone || row.state == SweepRunState::kLeftOut) continue;
    std::string message = row.last ? row.last->message : "";
    std::replace(message.begin(), message.end(), '\n', ' ');
    text += "- run " + std::to_string(row.index) + ", " + sweep_label(results.plan.runs[row.index]) + ": " +
            std::string(sweep_run_state_name(row.state)) + (message.empty() ? "" : ", " + message) + "\n";
  }
  return text;
}

std::string warnings_text(const SweepResults& results) {
  constexpr std::size_t kMostLines = 20;
  std::vector<std::pair<std::string, std::size_t>> counts;  // in the order of the runs
  for (const SweepRow& row : results.rows) {
    for (const std::string& warning : row.warnings) {
      const auto is_it = [&warning](const auto& known) { return known.first == warning; };
      const auto known = std::find_if(counts.begin(), counts.end(), is_it);
      if (known == counts.end()) {
        counts.emplace_back(warning, 1);
      } else {
        ++known->second;
      }
    }
  }
  std::stable_sort(counts.begin(), counts.end(), [](const auto& a, const auto& b) { return a.second > b.second; });
  std::string text;
  for (std::size_t i = 0; i < std::min(counts.size(), kMostLines); ++i)
    text += "- " + std::to_string(counts[i].second) + " of " + std::to_string(results.rows.size()) +
            (results.rows.size() == 1 ? " run: " : " runs: ") + counts[i].first + "\n";
  if (counts.size() > kMostLines)
    text += "- and " + std::to_string(counts.size() - kMostLines) + " others, in log.txt of the runs\n";
  return text;
}

std::string markdown_section(const Table& table) {
  if (table.rows.empty() || table.head.size() < 2) return "";
  return "## " + table.title + "\n\n" + table.caption + ".\n\n" + table_markdown(table);
}

std::string sweep_markdown(const SweepResults& results) {
  std::string text = "# " + results.plan.name + "\n\n" + progress_text(results) + "\n";
  const auto add = [&text](const Table& table) {
    const std::string section = markdown_section(table);
    text += section.empty() ? "" : "\n" + section;
  };
  if (results.count(SweepRunState::kDone) > 0) {
    for (const SearchResults& found : search_results(results)) add(best_points_table(found));
    add(mean_table(results));
    add(difference_table(results));
    if (results.clips.size() > 1) {
      for (const std::string& clip : results.clips) add(mean_table(results, &clip));
    }
  }
  const std::string unfinished = unfinished_text(results), warnings = warnings_text(results);
  if (!unfinished.empty()) text += "\n## Not done\n\n" + unfinished;
  return warnings.empty() ? text : text + "\n## Warnings\n\n" + warnings;
}

std::string sweep_csv(const SweepResults& results) {
  const std::vector<std::string> keys = value_keys(results.plan);
  Table table{.head = {"index", "run", "name", "block", "clip", "ablation", "seed"}};
  table.head.insert(table.head.end(), keys.begin(), keys.end());
  for (const char* const name : {"state", "starts", "programs", "version", "git", "program", "host", "peak_mb"})
    table.head.emplace_back(name);
  for (const MetricFacts* const metric : results.metrics) table.head.emplace_back(metric->name);
  for (const SweepRow& row : results.rows) {
    const SweepRun& run = results.plan.runs[row.index];
    std::vector<Cell> cells = {row.index, run.id, sweep_label(run), run.block, run.clip, run.ablation, run.seed};
    for (const std::string& key : keys) {
      const auto has =
          std::find_if(run.values.begin(), run.values.end(), [&key](const auto& value) { return value.first == key; });
      cells.emplace_back(has == run.values.end() ? "" : has->second);
    }
    const SweepAttempt last = row.last.value_or(SweepAttempt{});
    for (const Cell& cell : std::initializer_list<Cell>{sweep_run_state_name(row.state), row.starts, row.programs,
                                                        last.program.version, last.program.git, last.program.hash,
                                                        last.host, row.peak_mb > 0 ? number_text(row.peak_mb) : ""})
      cells.push_back(cell);
    for (const MetricFacts* const metric : results.metrics) {
      const double* const value = find_metric(row.values, metric->name);
      cells.emplace_back(value == nullptr ? "" : number_text(*value));
    }
    table.rows.push_back(std::move(cells));
  }
  return table_csv(table);
}

}  // namespace hsi4d
