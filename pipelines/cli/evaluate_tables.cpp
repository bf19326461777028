#include "pipelines/cli/evaluate_tables.h"

#include <algorithm>
#include <filesystem>
#include <optional>

#include "core/text.h"
#include "pipelines/cli/terminal.h"
#include "pipelines/cli/text.h"
#include "pipelines/record/published.h"

namespace hsi4d::cli {
namespace {

namespace fs = std::filesystem;

/// What stands beside the paper's figures: a result, or the row of a sweep.
std::vector<MeasuredRow> figure_columns(const std::vector<Evaluation>& results, const EvaluateInputs& inputs) {
  std::vector<MeasuredRow> columns;
  for (std::size_t i = 0; i < results.size(); ++i) {
    const bool is_of_sweep = std::any_of(inputs.sweeps.begin(), inputs.sweeps.end(), [i](const MeasuredSweep& sweep) {
      return i >= sweep.first && i < sweep.first + sweep.selection.runs.size();
    });
    if (!is_of_sweep) columns.push_back({results[i].name, {&results[i]}});
  }
  for (MeasuredRow& row : measured_rows(inputs, results)) columns.push_back(std::move(row));
  return columns;
}

/// The mean over those of a column that have the figure.
std::optional<double> figure_of(const PublishedFigure& figure, const MeasuredRow& column) {
  double sum = 0;
  int count = 0;
  for (const Evaluation* const result : column.results) {
    const double* const own = own_figure(figure, result->values, result->has_objects);
    if (own == nullptr) continue;
    sum += *own;
    ++count;
  }
  if (count == 0) return std::nullopt;
  return sum / count;
}

/// A sentence about a run of a sweep without the paths of its own folders, which differ from run to run.
std::string without_own_folders(std::string text, const EvaluateInputs& inputs, std::size_t index) {
  for (const MeasuredSweep& sweep : inputs.sweeps) {
    if (index < sweep.first || index >= sweep.first + sweep.selection.runs.size()) continue;
    const std::size_t run = sweep.selection.runs[index - sweep.first];
    const std::string& dataset = sweep.selection.plan.runs[run].dataset;
    std::vector<std::pair<fs::path, std::string>> own = {{sweep.selection.folder(run), "its folder"}};
    if (!dataset.empty()) own.emplace_back(sweep.selection.paths.dataset(dataset), "its dataset");
    for (const auto& [folder, name] : own) {
      for (const std::string& path : {fs::absolute(folder).lexically_normal().string(), folder.string()}) {
        for (std::size_t at = text.find(path); at != std::string::npos; at = text.find(path, at))
          text.replace(at, path.size(), name);
      }
    }
  }
  return text;
}

}  // namespace

std::string table_of(const std::vector<Evaluation>& results, const std::vector<Spread>& spreads, bool has_mean,
                     const std::vector<Diversity>& diversity) {
  Table table{.head = {""}};
  std::vector<const MetricValues*> sources;
  for (const Evaluation& result : results) {
    table.head.emplace_back(result.name);
    sources.push_back(&result.values);
  }
  if (has_mean) table.head.emplace_back("mean ± std");
  for (const Spread& spread : spreads) {
    const MetricFacts& facts = *spread.facts;
    std::vector<Cell> row = metric_row(facts, sources);
    if (has_mean) {
      row.emplace_back(fixed_number(spread.mean, facts.decimals) +
                       (spread.count > 1 ? " ± " + fixed_number(spread.deviation, facts.decimals) : ""));
    }
    table.rows.push_back(std::move(row));
  }
  for (const auto& [facts, value] : diversity) {
    std::vector<Cell> row(results.size() + 1, kNoCell);
    row[0] = shown_metric(*facts);
    row.push_back(metric_cell(*facts, &value));
    table.rows.push_back(std::move(row));
  }
  return table_text(table, stdout_columns());
}

std::string table_of_runs(const std::vector<Evaluation>& results, const std::vector<Spread>& spreads) {
  Table table{.head = {""}};
  for (const Spread& spread : spreads) table.head.emplace_back(shown_metric(*spread.facts));
  for (const Evaluation& result : results) {
    table.rows.push_back({result.name});
    for (const Spread& spread : spreads)
      table.rows.back().push_back(metric_cell(*spread.facts, find_metric(result.values, spread.facts->name)));
  }
  return table_text(table, stdout_columns());
}

std::string frames_text(const std::vector<Evaluation>& results) {
  std::string text;
  for (const Evaluation& result : results)
    text += result.name + ": frames 1 to " + std::to_string(result.frames - 1) + " at " +
            short_number(result.frame_rate) + " a second" + (result.truth.empty() ? "" : ", against " + result.truth) +
            "\n";
  for (const Evaluation& result : results) {
    for (const std::string& note : result.notes) text += result.name + ": " + note + "\n";
  }
  return text;
}

std::string notes_of_runs(const std::vector<Evaluation>& results, const EvaluateInputs& inputs) {
  std::vector<std::pair<std::string, std::vector<std::string>>> sentences;  // and whose they are
  const auto add = [&sentences](const std::string& sentence, const std::string& name) {
    const auto is_it = [&sentence](const auto& entry) { return entry.first == sentence; };
    auto found = std::find_if(sentences.begin(), sentences.end(), is_it);
    if (found == sentences.end()) found = sentences.insert(sentences.end(), {sentence, {}});
    found->second.push_back(name);
  };
  for (std::size_t i = 0; i < results.size(); ++i) {
    const Evaluation& result = results[i];
    const auto plain = [&](const std::string& text) { return without_own_folders(text, inputs, i); };
    add(plain("frames 1 to " + std::to_string(result.frames - 1) + " at " + short_number(result.frame_rate) +
              " a second" + (result.truth.empty() ? "" : ", against " + result.truth)),
        result.name);
    for (const std::string& note : result.notes) add(plain(note), result.name);
  }
  std::string text = "\n";
  for (const auto& [sentence, names] : sentences) {
    const bool is_of_all = names.size() == results.size();
    text += (is_of_all           ? "all"
             : names.size() == 1 ? names.front()
                                 : names.front() + " and " + count_text(std::ssize(names) - 1, "other")) +
            ": " + sentence + "\n";
  }
  return text;
}

std::string published_text(const std::vector<Evaluation>& results, const EvaluateInputs& inputs) {
  const std::vector<MeasuredRow> columns = figure_columns(results, inputs);
  std::vector<std::string> names;
  for (const MeasuredRow& column : columns) names.push_back(column.label);
  Table table = published_table(
      names, [&](const PublishedFigure& figure, std::size_t column) { return figure_of(figure, columns[column]); });
  std::erase_if(table.rows, [](const std::vector<Cell>& row) {
    return std::none_of(row.begin(), row.end(), [](const Cell& cell) { return cell.mark == "own"; });
  });
  if (table.rows.empty()) return "";
  return "\n" + table_text(table, stdout_columns()) + "Published: " + std::string(kPublishedSource) +
         ".\nThey are of other clips, which are not public: the order of magnitude can be compared.\n";
}

}  // namespace hsi4d::cli
