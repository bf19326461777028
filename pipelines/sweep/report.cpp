#include "pipelines/sweep/report.h"

#include <algorithm>
#include <filesystem>

#include "core/file.h"
#include "core/progress.h"
#include "core/text.h"
#include "pipelines/report/page.h"
#include "pipelines/sweep/plots.h"
#include "pipelines/sweep/tables.h"

namespace hsi4d {
namespace {

/// A plot a metric, side by side.
template <class MakePlot>
std::string metric_plots(const SweepResults& results, const std::string& title, const std::string& caption,
                         const MakePlot& make) {
  std::vector<std::pair<std::string, std::string>> plots;
  for (const MetricFacts* const metric : results.metrics) plots.emplace_back(metric_heading(*metric), make(*metric));
  return plots_section(title, caption, plots);
}

std::string header_section(const SweepResults& results) {
  const std::size_t done = results.count(SweepRunState::kDone), failed = results.count(SweepRunState::kFailed);
  const std::size_t left_out = results.count(SweepRunState::kLeftOut);
  const std::string state = done + left_out == results.rows.size() ? "done" : failed > 0 ? "failed" : "running";
  const std::string shown = state == "running" ? "not complete" : state == "failed" ? "with failures" : state;
  double seconds = 0;
  for (const SweepRow& row : results.rows) {
    if (const double* const value = find_metric(row.values, seconds_facts().name)) seconds += *value;
  }
  std::string text = "<header><h1>" + html_escape(results.plan.name) + "</h1><span class=\"badge " + state + "\">" +
                     shown + "</span></header>\n<dl class=\"facts\"><div><dt>runs</dt><dd>" +
                     html_escape(progress_text(results)) + "</dd></div><div><dt>time of all</dt><dd>" +
                     duration_text(seconds) + "</dd></div>";
  const std::string reference = reference_text(results.plan);
  if (!reference.empty()) text += "<div><dt>compared with</dt><dd>" + html_escape(reference) + "</dd></div>";
  return text + "</dl>\n";
}

/// Every run with its state and a link to its report.
std::string runs_section(const SweepResults& results) {
  Table table{.head = {"run", "index", "state", "starts", "time, s", "memory, MB", "program", "host"}};
  for (const SweepRow& row : results.rows) {
    const SweepRun& run = results.plan.runs[row.index];
    const SweepAttempt last = row.last.value_or(SweepAttempt{});
    const double* const seconds = find_metric(row.values, seconds_facts().name);
    const bool is_done = row.state == SweepRunState::kDone;
    Cell label = sweep_label(run);
    if (is_done) label.html = "<a href=\"runs/" + run.id + "/report.html\">" + html_escape(label.text) + "</a>";
    if (!is_done && !last.message.empty())
      label.html = html_escape(label.text) + "<p class=\"message\">" + html_escape(last.message) + "</p>";
    table.rows.push_back(
        {label, row.index, sweep_run_state_name(row.state), row.starts, seconds != nullptr ? Cell(*seconds, 1) : Cell(),
         row.peak_mb > 0 ? Cell(row.peak_mb, 0) : Cell(),
         last.program.version + (last.program.git.empty() ? "" : " (" + last.program.git + ")"), last.host});
  }
  return "<section><h2>Runs</h2>\n<div class=\"card wide\">" + table_html(table) + "</div></section>\n";
}

std::string warnings_section(const SweepResults& results) {
  const std::string text = warnings_text(results);
  return text.empty() ? ""
                      : "<section><h2>Warnings</h2>\n<p class=\"message\">" + html_escape(text) + "</p></section>\n";
}

std::string axes_sections(const SweepResults& results) {
  std::string text;
  for (const std::string& key : number_axes(results.plan))
    text += metric_plots(results, "By " + key, "Means over clips and seeds.",
                         [&](const MetricFacts& metric) { return axis_plot(results, key, metric); });
  return text;
}

/// What each search has found.
std::string search_sections(const SweepResults& results) {
  std::string text;
  for (const SearchResults& found : search_results(results)) {
    const MetricFacts& facts = *find_metric_facts(found.search->metric);
    const std::string of = found.label.empty() ? "" : ", " + found.label;
    text += table_section(best_points_table(found));
    text += "<section><h2>Points of the search" + html_escape(of) +
            "</h2>\n<p class=\"caption\">A line is a point, through its settings to its " + html_escape(facts.label) +
            (found.rungs > 1 ? " in each rung that it has come to" : "") +
            ", of which the best is at the top. The thick line is the best point; blue ones are good, orange ones "
            "bad.</p>\n<div class=\"card\">" +
            parallel_plot(found) + "</div></section>\n";
    std::vector<std::pair<std::string, std::string>> settings;
    for (std::size_t key = 0; key < found.search->over.size(); ++key)
      settings.emplace_back(found.search->over[key].key, setting_plot(found, key));
    text += plots_section(std::string(facts.label) + " by setting" + of,
                          std::string(found.rungs > 1 ? "Of the first rung, where all points are. " : "") +
                              "Dots are points in the same colours.",
                          settings);
    text +=
        metric_plots(results, "What matters" + of,
                     "How much of the variance of a metric's ranks a setting alone explains, beyond what it would "
                     "by chance; coloured where it is more than the mark, which 95 % of random orders do not reach.",
                     [&](const MetricFacts& metric) { return importance_plot(results, found, metric); });
  }
  return text;
}

/// False where every row is a point of a search, which plots of its own show.
bool has_rows_of_others(const SweepResults& results) {
  return std::any_of(results.groups.begin(), results.groups.end(), [&results](const SweepGroup& group) {
    return search_of(results.plan, results.plan.runs[group.rows.front()]) == nullptr;
  });
}

}  // namespace

std::string sweep_page(const SweepResults& results) {
  std::string page = header_section(results);
  if (results.count(SweepRunState::kDone) > 0) {
    page += search_sections(results) + table_section(mean_table(results)) + table_section(difference_table(results));
    const std::string reference = reference_text(results.plan);
    page += metric_plots(results, "Differences to " + reference,
                         "Dots are pairs of runs, the mark their mean, the bar its 95 % interval; coloured where that "
                         "does not contain 0 and there are at least six pairs.",
                         [&](const MetricFacts& metric) { return difference_plot(results, metric); });
    page += axes_sections(results);
    if (has_rows_of_others(results))
      page += metric_plots(results, "Runs by metric",
                           "Dots are runs, the mark their mean, the bar the standard deviation over the seeds.",
                           [&](const MetricFacts& metric) { return mean_plot(results, metric); });
    if (results.clips.size() > 1) {
      for (const std::string& clip : results.clips) page += table_section(mean_table(results, &clip));
    }
  }
  return html_page(results.plan.name, page + warnings_section(results) + runs_section(results));
}

SweepWritten write_sweep_results(const SweepPaths& paths) {
  const SweepFolderLock lock(paths);
  SweepWritten written{read_sweep_results(paths), ""};
  const std::string markdown = sweep_markdown(written.results);
  write_text_file(paths.csv(), sweep_csv(written.results));
  write_text_file(paths.markdown(), markdown);
  write_text_file(paths.report(), sweep_page(written.results));
  written.text = markdown + "\nreport: " + paths.report() + "\n";
  return written;
}

}  // namespace hsi4d
