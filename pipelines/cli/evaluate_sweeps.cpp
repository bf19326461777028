#include "pipelines/cli/evaluate_sweeps.h"

#include <algorithm>
#include <map>
#include <span>

#include "core/text.h"
#include "optim/motion_metrics.h"
#include "pipelines/cli/sweep_text.h"

namespace hsi4d::cli {
namespace {

/// What was measured of a run of the sweep; null: nothing.
const Evaluation* result_of(const MeasuredSweep& sweep, std::size_t row, const std::vector<Evaluation>& results) {
  const SweepPlan& plan = sweep.selection.plan;
  for (std::size_t i = 0; i < sweep.selection.runs.size(); ++i) {
    if (plan.runs[sweep.selection.runs[i]].id == plan.runs[row].id) return &results[sweep.first + i];
  }
  return nullptr;
}

/// The sweep as its report has it, with what was measured in place of what its runs have written; of those alone that
/// were named.
SweepResults measured(const MeasuredSweep& sweep, const std::vector<Evaluation>& results) {
  std::vector<SweepRow> rows(sweep.selection.plan.runs.size());
  for (std::size_t i = 0; i < rows.size(); ++i) rows[i].index = i;
  for (const std::size_t i : sweep.selection.named) {
    const Evaluation* const result = result_of(sweep, i, results);
    if (result == nullptr) continue;
    rows[i].state = SweepRunState::kDone;
    rows[i].values = result->values;
  }
  SweepResults all = sweep_results_of(sweep.selection.plan, std::move(rows));
  const std::vector<std::size_t>& named = sweep.selection.named;
  for (SweepGroup& group : all.groups)
    std::erase_if(group.rows,
                  [&named](std::size_t row) { return !std::binary_search(named.begin(), named.end(), row); });
  std::erase_if(all.groups, [](const SweepGroup& group) { return group.rows.empty(); });
  std::erase_if(all.clips, [&](const std::string& clip) {
    return std::none_of(named.begin(), named.end(), [&](std::size_t i) { return all.plan.runs[i].clip == clip; });
  });
  return all;
}

/// Of each diversity the mean over the clips of a row.
std::vector<Diversity> diversity_of_row(const SweepResults& all, const SweepGroup& group, const MeasuredSweep& sweep,
                                        const std::vector<Evaluation>& results) {
  std::map<std::string, std::vector<const Evaluation*>> clips;
  for (const std::size_t row : group.rows) {
    const Evaluation* const result = result_of(sweep, row, results);
    if (result != nullptr) clips[all.plan.runs[row].clip].push_back(result);
  }
  std::vector<Diversity> sums;
  double count = 0;
  for (const auto& [clip, repetitions] : clips) {
    const std::vector<Diversity> of_clip = diversity_of(repetitions);
    if (of_clip.empty()) continue;
    if (sums.empty()) sums.resize(of_clip.size(), {nullptr, 0});
    for (std::size_t i = 0; i < of_clip.size(); ++i) sums[i] = {of_clip[i].facts, sums[i].value + of_clip[i].value};
    ++count;
  }
  for (Diversity& sum : sums) sum.value /= count;
  return sums;
}

Table diversity_table(const SweepResults& all, const MeasuredSweep& sweep, const std::vector<Evaluation>& results) {
  Table table{.title = "Diversity over seeds",
              .caption = "Mean distance over all pairs of repetitions of a clip; means over clips"};
  for (const SweepGroup& group : all.groups) {
    const std::vector<Diversity> diversity = diversity_of_row(all, group, sweep, results);
    if (diversity.empty()) continue;
    table.head = {""};
    table.rows.push_back({group.label});
    for (const auto& [facts, value] : diversity) {
      table.head.emplace_back(metric_heading(*facts));
      table.rows.back().push_back(metric_cell(*facts, &value));
    }
  }
  return table;
}

ConfigValue difference_json(const PairedDifference& paired) {
  ConfigValue object = ConfigValue::make_object();
  object.add("mean", ConfigValue::make_number(paired.statistics.mean));
  if (paired.interval) {
    object.add("low", ConfigValue::make_number(paired.interval->low));
    object.add("high", ConfigValue::make_number(paired.interval->high));
  }
  object.add("pairs", ConfigValue::make_integer(std::ssize(paired.differences)));
  return object;
}

ConfigValue row_json(const SweepResults& all, const SweepGroup& group, const MeasuredSweep& sweep,
                     const std::vector<Evaluation>& results) {
  ConfigValue row = ConfigValue::make_object(), means = row, deviations = row, differences = row;
  row.add("name", ConfigValue::make_string(group.label));
  for (const MetricFacts* const facts : all.metrics) {
    const std::string name(facts->name);
    const SampleStatistics sample = group_statistics(all, group, *facts).sample;
    if (sample.count > 0) means.add(name, ConfigValue::make_number(sample.mean));
    if (sample.count > 1) deviations.add(name, ConfigValue::make_number(sample.deviation));
    if (const auto paired = paired_difference(all, group, *facts)) differences.add(name, difference_json(*paired));
  }
  for (const auto& [facts, value] : diversity_of_row(all, group, sweep, results))
    means.add(std::string(facts->name), ConfigValue::make_number(value));
  row.add("mean", std::move(means));
  row.add("std", std::move(deviations));
  if (!differences.members.empty()) row.add("difference", std::move(differences));
  return row;
}

}  // namespace

EvaluateInputs evaluate_inputs(const std::vector<std::string>& given) {
  EvaluateInputs inputs;
  for (const std::string& path : given) {
    std::optional<SweepSelection> selection = select_sweep_runs(path);
    if (!selection) {
      inputs.paths.push_back(path);
      inputs.names.push_back(path);
      continue;
    }
    const std::string before =
        given.size() == 1 ? "" : selection->paths.folder.lexically_normal().generic_string() + "/";
    const std::size_t first = inputs.paths.size();
    for (const std::size_t run : selection->runs) {
      inputs.paths.push_back(selection->folder(run).string());
      inputs.names.push_back(before + selection->name(run));
    }
    inputs.sweeps.push_back({*std::move(selection), first});
  }
  return inputs;
}

std::vector<Diversity> diversity_of(const std::vector<const Evaluation*>& results) {
  std::vector<std::vector<std::span<const double>>> motions;
  for (const Evaluation* const result : results) {
    if (result->frame_rate != results.front()->frame_rate ||
        result->joints.front().size() != results.front()->joints.front().size())
      return {};
    motions.emplace_back(result->joints.begin() + 1, result->joints.end());
  }
  std::vector<Diversity> diversity;
  for (const auto& [name, is_of_poses] : {std::pair{"diversity_mm", false}, {"diversity_pose_mm", true}}) {
    const std::optional<double> value = pairwise_distance_mm(motions, is_of_poses);
    if (value) diversity.push_back({find_metric_facts(name), *value});
  }
  return diversity;
}

std::vector<MeasuredRow> measured_rows(const EvaluateInputs& inputs, const std::vector<Evaluation>& results) {
  std::vector<MeasuredRow> rows;
  for (const MeasuredSweep& sweep : inputs.sweeps) {
    for (const SweepGroup& group : measured(sweep, results).groups) {
      MeasuredRow row{(inputs.sweeps.size() > 1 ? sweep.selection.text + ": " : "") + group.label, {}};
      for (const std::size_t i : group.rows) {
        const Evaluation* const result = result_of(sweep, i, results);
        if (result != nullptr) row.results.push_back(result);
      }
      if (!row.results.empty()) rows.push_back(std::move(row));
    }
  }
  return rows;
}

std::string sweeps_text(const EvaluateInputs& inputs, const std::vector<Evaluation>& results,
                        std::optional<int> columns) {
  std::string text;
  for (const MeasuredSweep& sweep : inputs.sweeps) {
    const SweepResults all = measured(sweep, results);
    if (inputs.sweeps.size() > 1) text += "\n" + sweep.selection.text + "\n";
    for (const Table& table : {mean_table(all), difference_table(all), diversity_table(all, sweep, results)}) {
      const std::string shown = sweep_table_text(table, columns);
      text += shown.empty() ? "" : "\n" + shown;
    }
    if (sweep.selection.not_done > 0)
      text += "\n" + sweep.selection.text + ": " + std::to_string(sweep.selection.not_done) + " not done, left out\n";
  }
  return text;
}

ConfigValue sweeps_json(const EvaluateInputs& inputs, const std::vector<Evaluation>& results) {
  ConfigValue list = ConfigValue::make_array();
  for (const MeasuredSweep& sweep : inputs.sweeps) {
    const SweepResults all = measured(sweep, results);
    ConfigValue object = ConfigValue::make_object(), rows = ConfigValue::make_array();
    object.add("sweep", ConfigValue::make_string(sweep.selection.text));
    const std::string reference = reference_text(all.plan);
    if (!reference.empty()) object.add("compared_with", ConfigValue::make_string(reference));
    for (const SweepGroup& group : all.groups) rows.items.push_back(row_json(all, group, sweep, results));
    object.add("rows", std::move(rows));
    list.items.push_back(std::move(object));
  }
  return list;
}

}  // namespace hsi4d::cli
