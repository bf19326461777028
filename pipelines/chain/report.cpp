#include "pipelines/chain/report.h"

#include <filesystem>

#include "core/config_value.h"
#include "core/file.h"
#include "core/json_text.h"
#include "core/progress.h"
#include "pipelines/chain/summary.h"
#include "pipelines/record/folder.h"
#include "pipelines/report/figure.h"
#include "pipelines/report/page.h"

namespace hsi4d {

namespace {

/// Errors by frame of the whole chain.
std::string errors_by_frame(const ChainSummary& summary) {
  std::vector<std::pair<std::string, std::string>> plots;
  for (const MetricFacts& facts : metric_facts()) {
    Plot plot{.title = std::string(facts.label),
              .x_label = "frame",
              .unit = std::string(facts.unit),
              .series = {{.label = "result", .color = "var(--result)", .points = {}}},
              .begins_at_zero = facts.better < 0,
              .decimals = facts.decimals};
    for (const FrameMetrics& frame : summary.all.per_frame) {
      if (const double* const value = find_metric(frame.values, facts.name))
        plot.series[0].points.emplace_back(frame.frame, *value);
    }
    if (!plot.series[0].points.empty()) plots.emplace_back(shown_metric(facts), plot_svg(plot));
  }
  return plots_section("Errors by frame", "", plots);
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
  return html_page(
      summary.all.name,
      "<header><h1>" + html_escape(summary.all.name) + "</h1><span class=\"badge done\">done</span></header>\n<p>" +
          std::to_string(summary.clips.size()) + " clips, " + std::to_string(summary.all.frames) + " frames, " +
          html_escape(duration_text(summary.all.seconds)) + "</p>\n" + clips_section(summary) +
          table_section(clip_table(summary)) + table_section(join_table(summary)) +
          table_section(quality_table(summary.all.quality)) + errors_by_frame(summary));
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
