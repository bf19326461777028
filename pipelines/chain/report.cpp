#include "pipelines/chain/report.h"

#include <filesystem>

#include "core/config_value.h"
#include "core/file.h"
#include "core/json_text.h"
#include "core/progress.h"
#include "pipelines/chain/summary.h"
#include "pipelines/record/folder.h"
#include "pipelines/report/assets.h"
#include "pipelines/report/plots.h"

namespace hsi4d {

namespace {

std::string table_section(const std::string& title, const std::string& caption, const ChainTable& table) {
  if (table.metrics.empty()) return "";
  std::string text = "<section><h2>" + title + "</h2>\n<p class=\"caption\">" + caption +
                     "</p>\n<div class=\"card wide\"><table class=\"errors\">\n<thead><tr><th></th>";
  for (const std::string& column : table.columns) text += "<th>" + html_escape(column) + "</th>";
  text += "</tr></thead>\n<tbody>\n";
  for (std::size_t m = 0; m < table.metrics.size(); ++m) {
    const MetricFacts& facts = *table.metrics[m];
    text += "<tr><th title=\"" + html_escape(std::string(facts.summary)) + "\">" + html_escape(shown_metric(facts)) +
            "</th>";
    for (const double* value : table.values[m]) text += "<td>" + html_escape(shown_value(facts, value)) + "</td>";
    text += "</tr>\n";
  }
  return text + "</tbody></table></div></section>\n";
}

/// Errors by frame of the whole chain, with a line where a clip begins.
std::string plots_section(const ChainSummary& summary) {
  std::string plots;
  for (const MetricFacts& facts : metric_facts()) {
    PlotLine line{"result", "var(--result)", {}};
    for (const FrameMetrics& frame : summary.all.per_frame) {
      if (const double* const value = find_metric(frame.values, facts.name))
        line.points.emplace_back(frame.frame, *value);
    }
    if (line.points.empty()) continue;
    Plot plot;
    plot.title = std::string(facts.label);
    plot.x_label = "frame";
    plot.unit = std::string(facts.unit);
    plot.decimals = facts.decimals;
    plot.begins_at_zero = facts.better < 0;
    plot.lines.push_back(std::move(line));
    plots += "<div class=\"card\"><h3>" + html_escape(shown_metric(facts)) + "</h3>" + plot_svg(plot) + "</div>\n";
  }
  return plots.empty() ? ""
                       : "<section><h2>Errors by frame</h2>\n<div class=\"plots\">\n" + plots + "</div></section>\n";
}

std::string clips_section(const ChainSummary& summary) {
  std::string text = "<section><h2>Clips</h2>\n<ul>\n";
  for (const ClipSummary& clip : summary.clips) {
    const int last = clip.begin + clip.summary.frames - 1;
    text += "<li><a href=\"clips/" + html_escape(clip.name) + "/report.html\">" + html_escape(clip.name) +
            "</a>: frames " + std::to_string(clip.begin) + " to " + std::to_string(last) + ", " +
            html_escape(duration_text(clip.summary.seconds)) + "</li>\n";
  }
  return text + "</ul></section>\n";
}

std::string page_of(const ChainSummary& summary) {
  const std::string name = html_escape(summary.all.name);
  std::string page =
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n<meta name=\"viewport\" "
      "content=\"width=device-width, initial-scale=1\"/>\n<title>" +
      name + "</title>\n<style>" + std::string(report_style()) + "</style>\n</head>\n<body>\n<main>\n<header><h1>" +
      name + "</h1><span class=\"badge done\">done</span></header>\n";
  page += "<p>" + std::to_string(summary.clips.size()) + " clips, " + std::to_string(summary.all.frames) + " frames, " +
          html_escape(duration_text(summary.all.seconds)) + "</p>\n";
  page += clips_section(summary);
  page +=
      table_section("Errors", "Of each clip's last stage, means over its frames after the first.", clip_table(summary));
  page += table_section("Joins",
                        "How far the first state of a clip is from the last one before it, and from the truth: the "
                        "drift up to there.",
                        join_table(summary));
  page += plots_section(summary);
  return page + "</main>\n</body>\n</html>\n";
}

}  // namespace

bool is_chain_folder(const std::string& folder) {
  const std::string file = RunPaths{folder}.config();
  if (!std::filesystem::exists(file)) return false;
  const ConfigValue tree = parse_json_text(read_text_file(file), file);
  const ConfigValue* const chain = find_member(tree, "chain");
  return chain != nullptr && !chain->items.empty();
}

std::string write_chain_report(const std::string& folder) {
  const RunPaths paths{folder};
  const std::string page = page_of(parse_chain_summary(read_text_file(paths.summary()), paths.summary()));
  write_text_file(paths.report(), page);
  return paths.report();
}

}  // namespace hsi4d
