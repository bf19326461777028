#include "pipelines/cli/sweep_text.h"

#include "pipelines/cli/terminal.h"
#include "pipelines/cli/text.h"
#include "pipelines/sweep/search_results.h"

namespace hsi4d::cli {

std::string sweep_table_text(const Table& table, std::optional<int> columns) {
  if (!columns || table.rows.empty() || table.head.size() < 2) return markdown_section(table);
  const std::string text = table_text(table, columns);
  const std::string caption = table.caption + (text.find('*') == std::string::npos ? "." : " (*).");
  return table.title + "\n\n" + wrapped(caption, static_cast<std::size_t>(*columns)) + "\n\n" + text;
}

std::string sweep_text(const SweepPaths& paths, const SweepResults& results, int columns) {
  std::string text = results.plan.name + ": " + progress_text(results) + "\n";
  const auto add = [&text](const std::string& table) { text += table.empty() ? "" : "\n" + table; };
  if (results.count(SweepRunState::kDone) > 0) {
    for (const SearchResults& found : search_results(results)) add(sweep_table_text(best_points_table(found), columns));
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
