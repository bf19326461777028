#include "pipelines/cli/sweep_text.h"

#include "pipelines/cli/terminal.h"
#include "pipelines/cli/text.h"

namespace hsi4d::cli {

std::string sweep_table_text(const SweepTable& table, std::optional<int> columns) {
  if (table.rows.empty() || table.columns.empty()) return "";
  if (!columns) return "## " + table.title + "\n\n" + table.caption + ".\n\n" + markdown_of(table);
  std::vector<std::vector<std::string>> rows = {{""}};
  rows[0].insert(rows[0].end(), table.columns.begin(), table.columns.end());
  bool has_marks = false;
  for (const SweepTable::Row& row : table.rows) {
    rows.push_back({row.label});
    for (const SweepCell& cell : row.cells) {
      const bool is_marked = cell.mark != SweepCell::Mark::kNone && !cell.text.empty();
      rows.back().push_back(cell.text + (is_marked ? "*" : ""));
      has_marks = has_marks || is_marked;
    }
  }
  return table.title + "\n\n" +
         wrapped(table.caption + (has_marks ? " (*)." : "."), static_cast<std::size_t>(*columns)) + "\n\n" +
         folded_table(std::move(rows), columns);
}

std::string sweep_text(const SweepPaths& paths, const SweepResults& results, int columns) {
  std::string text = results.plan.name + ": " + progress_text(results) + "\n";
  const auto add = [&text](const std::string& table) { text += table.empty() ? "" : "\n" + table; };
  if (results.count(SweepRunState::kDone) > 0) {
    add(sweep_table_text(mean_table(results), columns));
    add(sweep_table_text(difference_table(results), columns));
  }
  const std::string unfinished = unfinished_text(results);
  if (!unfinished.empty()) text += "\nnot done:\n" + unfinished;
  const std::string warnings = warnings_text(results);
  if (!warnings.empty()) text += "\nwarnings:\n" + warnings;
  return text + "\nreport: " + paths.report() + "\nwhole tables" +
         (results.clips.size() > 1 ? ", of each clip too: " : ": ") + paths.markdown() + "\n";
}

std::string write_and_show_results(const SweepPaths& paths) {
  const SweepWritten written = write_sweep_results(paths);
  const std::optional<int> columns = stdout_columns();
  return columns ? sweep_text(paths, written.results, *columns) : written.text;
}

}  // namespace hsi4d::cli
