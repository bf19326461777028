#include "pipelines/sweep/report.h"

#include <filesystem>

#include "core/file.h"
#include "core/progress.h"
#include "core/text.h"
#include "pipelines/report/assets.h"
#include "pipelines/report/plots.h"
#include "pipelines/sweep/plots.h"
#include "pipelines/sweep/tables.h"

namespace hsi4d {
namespace {

const char* class_of(SweepCell::Mark mark) {
  switch (mark) {
    case SweepCell::Mark::kBest:
      return " class=\"best\"";
    case SweepCell::Mark::kBetter:
      return " class=\"better\"";
    case SweepCell::Mark::kWorse:
      return " class=\"worse\"";
    case SweepCell::Mark::kNone:
      break;
  }
  return "";
}

std::string html_of(const SweepTable& table) {
  if (table.rows.empty() || table.columns.empty()) return "";
  std::string text = "<section><h2>" + html_escape(table.title) + "</h2>\n<p class=\"caption\">" +
                     html_escape(table.caption) +
                     ".</p>\n<div class=\"card wide\"><table class=\"errors\">\n<thead><tr><th></th>";
  for (const std::string& column : table.columns) text += "<th>" + html_escape(column) + "</th>";
  text += "</tr></thead>\n<tbody>\n";
  for (const SweepTable::Row& row : table.rows) {
    text += "<tr><th>" + html_escape(row.label) + "</th>";
    for (const SweepCell& cell : row.cells)
      text += std::string("<td") + class_of(cell.mark) + ">" + html_escape(cell.text) + "</td>";
    text += "</tr>\n";
  }
  return text + "</tbody></table></div></section>\n";
}

/// A plot a metric, side by side.
template <class MakePlot>
std::string plots_section(const SweepResults& results, const std::string& title, const std::string& caption,
                          const MakePlot& make) {
  std::string plots;
  for (const MetricFacts* const metric : results.metrics) {
    const std::string plot = make(*metric);
    if (!plot.empty())
      plots += "<div class=\"card\"><h3>" + html_escape(metric_heading(*metric)) + "</h3>" + plot + "</div>\n";
  }
  if (plots.empty()) return "";
  return "<section><h2>" + html_escape(title) + "</h2>\n<p class=\"caption\">" + html_escape(caption) +
         "</p>\n<div class=\"plots\">\n" + plots + "</div></section>\n";
}

std::string header_section(const SweepResults& results) {
  const std::size_t done = results.count(SweepRunState::kDone), failed = results.count(SweepRunState::kFailed);
  const std::string state = done == results.rows.size() ? "done" : failed > 0 ? "failed" : "running";
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
  std::string text =
      "<section><h2>Runs</h2>\n<div class=\"card wide\"><table>\n<thead><tr><th>run</th><th>index</th><th>state</th>"
      "<th>starts</th><th>time, s</th><th>memory, MB</th><th>program</th><th>host</th></tr></thead>\n<tbody>\n";
  for (const SweepRow& row : results.rows) {
    const SweepRun& run = results.plan.runs[row.index];
    const std::string label = html_escape(sweep_label(run));
    const SweepAttempt last = row.last.value_or(SweepAttempt{});
    const double* const seconds = find_metric(row.values, seconds_facts().name);
    const bool is_done = row.state == SweepRunState::kDone;
    text += "<tr><td>" + (is_done ? "<a href=\"runs/" + run.id + "/report.html\">" + label + "</a>" : label) +
            "</td><td>" + std::to_string(row.index) + "</td><td>" + std::string(sweep_run_state_name(row.state)) +
            "</td><td>" + std::to_string(row.starts) + "</td><td>" +
            (seconds != nullptr ? fixed_number(*seconds, 1) : "") + "</td><td>" +
            (row.peak_mb > 0 ? fixed_number(row.peak_mb, 0) : "") + "</td><td>" +
            html_escape(last.program.version + (last.program.git.empty() ? "" : " (" + last.program.git + ")")) +
            "</td><td>" + html_escape(last.host) + "</td></tr>\n";
    if (!is_done && !last.message.empty())
      text += "<tr><td colspan=\"8\"><p class=\"message\">" + html_escape(last.message) + "</p></td></tr>\n";
  }
  return text + "</tbody></table></div></section>\n";
}

std::string warnings_section(const SweepResults& results) {
  const std::string text = warnings_text(results);
  return text.empty() ? ""
                      : "<section><h2>Warnings</h2>\n<p class=\"message\">" + html_escape(text) + "</p></section>\n";
}

std::string axes_sections(const SweepResults& results) {
  std::string text;
  for (const std::string& key : number_axes(results.plan))
    text += plots_section(results, "By " + key, "Means over clips and seeds.",
                          [&](const MetricFacts& metric) { return axis_plot(results, key, metric); });
  return text;
}

}  // namespace

std::string sweep_page(const SweepResults& results) {
  const std::string name = html_escape(results.plan.name);
  std::string page =
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n<meta name=\"viewport\" "
      "content=\"width=device-width, initial-scale=1\"/>\n<title>" +
      name + "</title>\n<style>" + std::string(report_style()) + "</style>\n</head>\n<body>\n<main>\n" +
      header_section(results);
  if (results.count(SweepRunState::kDone) > 0) {
    page += html_of(mean_table(results)) + html_of(difference_table(results));
    const std::string reference = reference_text(results.plan);
    page += plots_section(results, "Differences to " + reference,
                          "Dots are pairs of runs, the mark their mean, the bar its 95 % interval; coloured where that "
                          "does not contain 0 and there are at least six pairs.",
                          [&](const MetricFacts& metric) { return difference_plot(results, metric); });
    page += axes_sections(results);
    page += plots_section(results, "Runs by metric",
                          "Dots are runs, the mark their mean, the bar the standard deviation over the seeds.",
                          [&](const MetricFacts& metric) { return mean_plot(results, metric); });
    if (results.clips.size() > 1) {
      for (const std::string& clip : results.clips) page += html_of(mean_table(results, &clip));
    }
  }
  return page + warnings_section(results) + runs_section(results) + "</main>\n</body>\n</html>\n";
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
