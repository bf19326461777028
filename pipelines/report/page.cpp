#include "pipelines/report/page.h"

#include <algorithm>
#include <cmath>

#include "core/progress.h"
#include "pipelines/report/assets.h"
#include "pipelines/report/plots.h"
#include "pipelines/report/published.h"

namespace hsi4d {
namespace {

std::string text_of(std::string_view text) { return html_escape(std::string(text)); }

const MetricValues* baseline_values(const RunSummary& summary, std::string_view name) {
  for (const Baseline& baseline : summary.baselines) {
    if (baseline.name == name) return &baseline.values;
  }
  return nullptr;
}

// ---- Head ----

std::string state_badge(const ReportData& data) {
  const std::vector<std::string> known = {"running", "done", "failed", "interrupted"};
  const bool is_known = std::find(known.begin(), known.end(), data.state) != known.end();
  const std::string shown = data.is_orphaned ? "stopped without a word" : data.state;
  return "<span class=\"badge " + (is_known ? data.state : "unknown") + "\">" + text_of(shown) + "</span>";
}

std::string head_section(const ReportData& data) {
  std::string text = "<header><h1>" + text_of(data.name) + "</h1>" + state_badge(data) + "</header>\n";
  if (data.is_orphaned)
    text +=
        "<p class=\"message\">Its status says that it is running, but no process writes this folder any more: it "
        "was killed, or this is a copy.</p>\n";
  if (!data.message.empty()) text += "<p class=\"message\">" + text_of(data.message) + "</p>\n";
  text += "<dl class=\"facts\">\n";
  for (const auto& [label, value] : data.facts)
    text += "<div><dt>" + text_of(label) + "</dt><dd>" + text_of(value) + "</dd></div>\n";
  return text + "</dl>\n";
}

constexpr double kMostPercent = 999;  // beyond this a share tells nothing more

/// Whether a result is worse than the start, in the digits that are shown.
bool is_worse(const MetricFacts& facts, double value, double start) {
  return (value - start) * facts.better < 0 &&
         fixed_number(value, facts.decimals) != fixed_number(start, facts.decimals);
}

/// "from 64.0, −72 %": how a result stands to the start.
std::string change_text(const MetricFacts& facts, double value, double start) {
  std::string text = "from " + fixed_number(start, facts.decimals);
  if (start == 0) return text;
  // Decibels are logarithms and similarities end at 1: their differences say more than their ratios.
  const bool is_ratio = facts.better < 0;
  const double change = is_ratio ? 100 * (value - start) / std::fabs(start) : value - start;
  const int decimals = is_ratio ? 0 : facts.decimals;
  const std::string digits = fixed_number(std::fabs(change), decimals);
  if (digits == fixed_number(0, decimals)) return text + ", unchanged";
  const bool is_beyond = is_ratio && std::fabs(change) > kMostPercent;
  return text + " <span class=\"" + (is_worse(facts, value, start) ? "worse" : "better") + "\">" +
         (is_beyond ? "&gt; " : "") + (change < 0 ? "−" : "+") + (is_beyond ? fixed_number(kMostPercent, 0) : digits) +
         (is_ratio ? "\u00A0%" : "") + "</span>";
}

bool is_worse(const MetricFacts& facts, const MetricValues& values, const MetricValues& start) {
  const double* const value = find_metric(values, facts.name);
  const double* const before = find_metric(start, facts.name);
  return value != nullptr && before != nullptr && is_worse(facts, *value, *before);
}

bool is_better(const MetricFacts& facts, const MetricValues& values, const MetricValues& start) {
  return is_worse(facts, start, values);
}

/// A body that sinks in less deep with more of it, or the other way round, is not worse: of the two numbers of
/// penetration neither says much alone.
bool is_redeemed(const MetricFacts& facts, const MetricValues& values, const MetricValues& start) {
  constexpr std::string_view kShare = "penetration_share", kDepth = "penetration_depth_mm";
  if (facts.name == kShare) return is_better(*find_metric_facts(kDepth), values, start);
  if (facts.name == kDepth) return is_better(*find_metric_facts(kShare), values, start);
  return false;
}

/// What the last stage left worse than a baseline: the run did harm there, and its reader is told first.
/// @param name  of the baseline, for people
/// @param skip  the metric that is left out; empty: none
std::string worse_message(const RunSummary& summary, const MetricValues& baseline, const std::string& name,
                          std::string_view skip = "") {
  const MetricValues& values = summary.metrics.back().values;
  std::string worse;
  for (const MetricFacts& facts : metric_facts()) {
    if (facts.name != skip && is_worse(facts, values, baseline) && !is_redeemed(facts, values, baseline))
      worse += (worse.empty() ? "" : "; ") + std::string(facts.label);
  }
  return worse.empty() ? "" : "<p class=\"message\">Worse than " + name + ": " + text_of(worse) + ".</p>\n";
}

/// Against both baselines. What stands still does not tremble: of copy_frame_0 that is no merit.
std::string worse_messages(const RunSummary& summary) {
  const MetricValues *const start = baseline_values(summary, "start"), *const copy =
                                                                           baseline_values(summary, "copy_frame_0");
  return (start == nullptr ? "" : worse_message(summary, *start, "the start")) +
         (copy == nullptr ? "" : worse_message(summary, *copy, "frame 0 copied", "jitter"));
}

/// The few numbers that a reader wants first: of the last stage, against the start.
std::string figures_section(const RunSummary& summary) {
  if (summary.metrics.empty()) return "";
  const MetricValues* const start = baseline_values(summary, "start");
  std::string cards;
  for (const char* const name : {"mpjpe_mm", "world_mpjpe_mm", "object_translation_cm", "object_rotation_deg",
                                 "camera_translation_cm", "psnr_foreground_db"}) {
    const MetricFacts& facts = *find_metric_facts(name);
    const double* const value = find_metric(summary.metrics.back().values, name);
    if (value == nullptr) continue;
    const double* const before = start == nullptr ? nullptr : find_metric(*start, name);
    const bool worse = before != nullptr && is_worse(facts, *value, *before);
    cards += std::string("<div class=\"card figure") + (worse ? " harmed" : "") + "\" title=\"" +
             text_of(facts.summary) + "\"><div class=\"label\">" + text_of(facts.label) +
             "</div><div class=\"value\">" + fixed_number(*value, facts.decimals) + " <small>" + text_of(facts.unit) +
             "</small></div><div class=\"before\">" +
             (before == nullptr || facts.better == 0 ? "" : change_text(facts, *value, *before)) + "</div></div>\n";
  }
  if (cards.empty()) return "";
  return worse_messages(summary) + "<div class=\"figures\">\n" + cards + "</div>\n";
}

// ---- Errors ----

/// A row a metric and a column a result, as on the terminal: results are few, and pages are narrow.
std::string errors_section(const ReportData& data) {
  std::string text = "<section id=\"errors\">\n<h2>Errors</h2>\n";
  const ErrorTable table = data.summary ? make_error_table(*data.summary) : ErrorTable();
  if (table.columns.empty()) return text + "<p class=\"nothing\">No errors were measured.</p>\n</section>\n";
  const auto column = [](const ErrorTable::Row& row) {
    return std::string(row.is_baseline ? " class=\"baseline\"" : "");
  };
  text += "<div class=\"card wide\"><table class=\"errors\">\n<thead><tr><th>error</th>";
  for (const ErrorTable::Row& row : table.rows) text += "<th" + column(row) + ">" + row_label(row.name) + "</th>";
  text += "</tr></thead>\n<tbody>\n";
  for (size_t m = 0; m < table.columns.size(); ++m) {
    const MetricFacts& facts = *table.columns[m];
    text += "<tr><th scope=\"row\" title=\"" + text_of(facts.summary) + "\">" + text_of(facts.label) +
            " <span class=\"unit\">" + text_of(facts.unit) +
            (facts.better > 0   ? " ↑"
             : facts.better < 0 ? " ↓"
                                : "") +
            "</span></th>";
    for (size_t r = 0; r < table.rows.size(); ++r) {
      const double* const value = table.rows[r].values[m];
      text += value == nullptr ? "<td class=\"none\">–</td>"
                               : (table.is_best(r, m) ? "<td class=\"best\">" : "<td" + column(table.rows[r]) + ">") +
                                     fixed_number(*value, facts.decimals) + "</td>";
    }
    text += "</tr>\n";
  }
  std::string of_frame_0;
  for (const ErrorTable::Row& row : table.rows) {
    if (row.of_frame_0) of_frame_0 += (of_frame_0.empty() ? "" : ", ") + row_label(row.name);
  }
  return text +
         "</tbody></table></div>\n<p class=\"caption\">Means over the frames that were optimised; columns in grey are "
         "what no optimisation gives, the others the end of each stage. The best of each row is "
         "marked." +
         (of_frame_0.empty() ? "" : " Of frame 0 alone, and compared with each other: " + of_frame_0 + ".") +
         "</p>\n</section>\n";
}

// ---- Errors by frame ----

PlotLine frame_line(const std::string& label, const std::string& color, const std::vector<FrameMetrics>& frames,
                    std::string_view metric) {
  PlotLine line{label, color, {}, false, true, 1};
  for (const FrameMetrics& frame : frames) {
    const double* const value = find_metric(frame.values, metric);
    if (value != nullptr) line.points.emplace_back(frame.frame, *value);
  }
  return line;
}

std::string baseline_color(const Baseline& baseline) {
  return baseline.name == "start" ? "var(--start)" : "var(--copy)";
}

/// A baseline by frame, or its mean as a dashed line across.
PlotLine baseline_line(const Baseline& baseline, const RunSummary& summary, std::string_view metric) {
  PlotLine line = frame_line(baseline.name, baseline_color(baseline), baseline.per_frame, metric);
  const double* const mean = find_metric(baseline.values, metric);
  if (!line.points.empty() || mean == nullptr) return line;
  line.label += " (mean)";
  line.is_dashed = true;
  line.has_dots = false;
  for (const FrameMetrics* const end : {&summary.per_frame.front(), &summary.per_frame.back()})
    line.points.emplace_back(end->frame, *mean);
  return line;
}

std::string frame_errors_legend(const RunSummary& summary) {
  std::string text = "<p class=\"legend\">";
  for (const Baseline& baseline : summary.baselines) {
    if (baseline.of_frame_0) continue;
    text += "<span><span class=\"key" + std::string(baseline.per_frame.empty() ? " dashed" : "") +
            "\" style=\"border-color:" + baseline_color(baseline) + "\"></span>" + row_label(baseline.name) +
            (baseline.per_frame.empty() ? ", mean" : "") + "</span>";
  }
  return text + "<span><span class=\"key\" style=\"border-color:var(--result)\"></span>result</span></p>\n";
}

std::string frame_errors_section(const RunSummary& summary) {
  std::string cards;
  for (const MetricFacts& facts : metric_facts()) {
    Plot plot;
    plot.title = std::string(facts.label) + " by frame";
    plot.x_label = "frame";
    plot.is_timed = true;
    plot.unit = facts.unit;
    plot.decimals = facts.decimals;
    plot.begins_at_zero = facts.better <= 0;
    const PlotLine result = frame_line("result", "var(--result)", summary.per_frame, facts.name);
    if (result.points.empty()) continue;
    for (const Baseline& baseline : summary.baselines) {
      if (!baseline.of_frame_0) plot.lines.push_back(baseline_line(baseline, summary, facts.name));
    }
    plot.lines.push_back(result);
    cards += "<div class=\"card\" title=\"" + text_of(facts.summary) + "\"><h3>" + text_of(facts.label) +
             (facts.unit.empty() ? "" : " [" + text_of(facts.unit) + "]") + "</h3>" + plot_svg(plot) + "</div>\n";
  }
  if (cards.empty()) return "";
  return "<section id=\"errors-by-frame\">\n<h2>Errors by frame</h2>\n" + frame_errors_legend(summary) +
         "<div class=\"plots\">\n" + cards + "</div>\n</section>\n";
}

// ---- Losses ----

constexpr size_t kMostBuckets = 80;

/// Fewer points of the same look: the smallest and the largest of every bucket.
std::vector<std::pair<double, double>> thinned(const std::vector<std::pair<double, double>>& points) {
  if (points.size() <= 2 * kMostBuckets) return points;
  const size_t size = (points.size() + kMostBuckets - 1) / kMostBuckets;
  std::vector<std::pair<double, double>> kept;
  for (size_t begin = 0; begin < points.size(); begin += size) {
    const auto first = points.begin() + static_cast<std::ptrdiff_t>(begin);
    const auto last = points.begin() + static_cast<std::ptrdiff_t>(std::min(begin + size, points.size()));
    auto [low, high] =
        std::minmax_element(first, last, [](const auto& a, const auto& b) { return a.second < b.second; });
    if (high < low) std::swap(low, high);
    kept.push_back(*low);
    if (high != low) kept.push_back(*high);
  }
  return kept;
}

/// From blue over violet to orange, readable on light and dark.
std::string ramp_color(size_t i, size_t count) {
  const double share = count < 2 ? 0 : static_cast<double>(i) / static_cast<double>(count - 1);
  return "hsl(" + fixed_number(std::fmod(215 + 175 * share, 360), 0) + " 65% 55%)";
}

std::string loss_number(double value) {
  return value == 0 || std::fabs(value) >= 0.01 ? fixed_number(value, 4) : fixed_number(value, 6);
}

std::string loss_caption(const StageCurves& stage) {
  double first = 0, last = 0;
  int count = 0;
  for (const LossCurve& curve : stage.curves) {
    if (curve.points.empty()) continue;
    first += curve.points.front().second;
    last += curve.points.back().second;
    ++count;
  }
  if (count == 0) return "";
  return "<p class=\"caption\">mean first loss " + loss_number(first / count) + ", mean last loss " +
         loss_number(last / count) +
         (stage.curves.front().frame ? " over " + std::to_string(count) + (count == 1 ? " frame" : " frames")
                                     : " of all frames together") +
         "</p>";
}

std::string curve_name(const LossCurve& curve) {
  return curve.frame ? "frame " + std::to_string(*curve.frame) : "all frames";
}

std::string ramp_legend(const StageCurves& stage) {
  if (stage.curves.size() < 2) return "";
  std::string stops;
  for (size_t i = 0; i < 5; ++i) stops += (i == 0 ? "" : ", ") + ramp_color(i, 5);
  return "<p class=\"legend\"><span>" + curve_name(stage.curves.front()) +
         "<span class=\"ramp\" style=\"background:linear-gradient(to right, " + stops + ")\"></span>" +
         curve_name(stage.curves.back()) + "</span></p>";
}

std::string losses_section(const ReportData& data) {
  if (data.stages.empty()) return "";
  std::string text = "<section id=\"losses\">\n<h2>Losses</h2>\n<div class=\"plots\">\n";
  for (const StageCurves& stage : data.stages) {
    Plot plot;
    plot.title = "loss of stage " + stage.stage;
    plot.x_label = "iteration";
    plot.is_log = true;
    plot.width = 560;
    for (size_t i = 0; i < stage.curves.size(); ++i) {
      const LossCurve& curve = stage.curves[i];
      plot.lines.push_back({curve_name(curve), ramp_color(i, stage.curves.size()), thinned(curve.points), false, false,
                            stage.curves.size() > 12 ? 0.6 : 0.9});
    }
    text += "<div class=\"card\"><h3>" + row_label(stage.stage) + "</h3>" + ramp_legend(stage) + plot_svg(plot) +
            loss_caption(stage) + "</div>\n";
  }
  return text + "</div>\n</section>\n";
}

// ---- Shares of the gradient ----

/// A row a group, a column a term with its share and its cosine.
std::string shares_table(const std::vector<MeanGradientShare>& shares) {
  std::vector<std::string> groups, terms;
  for (const MeanGradientShare& share : shares) {
    if (std::find(groups.begin(), groups.end(), share.group) == groups.end()) groups.push_back(share.group);
    if (std::find(terms.begin(), terms.end(), share.term) == terms.end()) terms.push_back(share.term);
  }
  std::string text = "<table>\n<thead><tr><th>group</th>";
  for (const std::string& term : terms) text += "<th>" + row_label(term) + "</th>";
  text += "</tr></thead>\n<tbody>\n";
  for (const std::string& group : groups) {
    text += "<tr><th scope=\"row\">" + row_label(group) + "</th>";
    for (const std::string& term : terms) {
      const auto at = std::find_if(shares.begin(), shares.end(), [&](const MeanGradientShare& share) {
        return share.group == group && share.term == term;
      });
      text += at == shares.end()
                  ? "<td class=\"none\">–</td>"
                  : "<td>" + fixed_number(100 * at->share, 1) + " % (" + fixed_number(at->cosine, 2) + ")</td>";
    }
    text += "</tr>\n";
  }
  return text + "</tbody></table>";
}

std::string shares_section(const ReportData& data) {
  if (!data.summary) return "";
  std::string cards;
  for (const StageSummary& stage : data.summary->metrics) {
    if (stage.gradient_shares.empty()) continue;
    cards += "<div class=\"card wide\"><h3>" + row_label(stage.stage) + "</h3>" + shares_table(stage.gradient_shares) +
             "</div>\n";
  }
  if (cards.empty()) return "";
  return "<section id=\"shares\">\n<h2>Shares of the gradient</h2>\n" + cards +
         "<p class=\"caption\">How much of the gradient of a group of parameters comes from which loss term, means "
         "over "
         "the iterations that were looked at; in brackets the cosine with the whole gradient, below 0 where the term "
         "pulls against it.</p>\n</section>\n";
}

// ---- Time ----

struct TimeRow {
  std::string name;
  double seconds = 0;
  Index iterations = 0;
  const MetricValues* values = nullptr;  // counters are among them
};

std::vector<TimeRow> time_rows(const ReportData& data) {
  std::vector<TimeRow> rows;
  if (data.summary) {
    double sum = data.summary->start.seconds;
    if (sum > 0) rows.push_back({"start", sum, 0, nullptr});  // which of several was the best
    for (const StageSummary& stage : data.summary->metrics) {
      rows.push_back({stage.stage, stage.seconds, stage.iterations, &stage.values});
      sum += stage.seconds;
    }
    if (data.summary->seconds > sum * 1.001 + 0.05) rows.push_back({"other", data.summary->seconds - sum, 0, nullptr});
  } else {
    for (const StageCurves& stage : data.stages)
      rows.push_back({stage.stage, stage.seconds, stage.iterations, nullptr});
  }
  return rows;
}

std::vector<std::string> counter_names(const std::vector<TimeRow>& rows) {
  std::vector<std::string> names;
  for (const TimeRow& row : rows) {
    if (row.values == nullptr) continue;
    for (const auto& [name, value] : *row.values) {
      if (find_metric_facts(name) == nullptr && std::find(names.begin(), names.end(), name) == names.end())
        names.push_back(name);
    }
  }
  return names;
}

/// 1234567 -> "1 234 567", with blanks that do not break.
std::string counter_text(double value) {
  if (value != std::floor(value)) return fixed_number(value, 3);
  std::string digits = fixed_number(value, 0);
  for (auto at = static_cast<std::ptrdiff_t>(digits.size()) - 3; at > (value < 0 ? 1 : 0); at -= 3)
    digits.insert(static_cast<size_t>(at), "\xE2\x80\xAF");
  return digits;
}

std::string time_section(const ReportData& data) {
  const std::vector<TimeRow> rows = time_rows(data);
  double total = 0;
  for (const TimeRow& row : rows) total += row.seconds;
  if (!(total > 0)) return "";
  std::vector<std::pair<std::string, double>> parts;
  for (const TimeRow& row : rows) parts.emplace_back(row.name, row.seconds);
  const std::vector<std::string> counters = counter_names(rows);
  std::string text = "<section id=\"time\">\n<h2>Time</h2>\n" + share_bar_svg("time by stage", parts) +
                     "\n<div class=\"card wide\"><table>\n<thead><tr><th>stage</th><th>seconds</th><th>share</th>"
                     "<th>iterations</th><th>ms an iteration</th>";
  for (const std::string& name : counters) text += "<th>" + row_label(name) + "</th>";
  text += "</tr></thead>\n<tbody>\n";
  for (size_t i = 0; i < rows.size(); ++i) {
    const TimeRow& row = rows[i];
    const std::string none = "<td class=\"none\">–</td>";
    text += "<tr><th scope=\"row\"><span class=\"box\" style=\"background:" + part_color(i) + "\"></span>" +
            row_label(row.name) + "</th><td>" + fixed_number(row.seconds, 2) + "</td><td>" +
            fixed_number(100 * row.seconds / total, 1) + " %</td>";
    text += row.iterations == 0
                ? none + none
                : "<td>" + counter_text(static_cast<double>(row.iterations)) + "</td><td>" +
                      fixed_number(1000 * row.seconds / static_cast<double>(row.iterations), 2) + "</td>";
    for (const std::string& name : counters) {
      const double* const value = row.values == nullptr ? nullptr : find_metric(*row.values, name);
      text += value == nullptr ? none : "<td>" + counter_text(*value) + "</td>";
    }
    text += "</tr>\n";
  }
  return text + "</tbody></table></div>\n</section>\n";
}

// ---- The rest ----

std::string notes_section(const ReportData& data) {
  if (data.notes.empty()) return "";
  std::string text = "<section id=\"notes\">\n<h2>Notes</h2>\n<div class=\"card\"><ul class=\"notes\">\n";
  for (const std::string& note : data.notes) text += "<li>" + text_of(note) + "</li>\n";
  return text + "</ul></div>\n</section>\n";
}

std::string config_section(const ReportData& data) {
  if (data.config.empty()) return "";
  return "<section id=\"config\">\n<h2>Settings</h2>\n<div "
         "class=\"card\"><details><summary>config.resolved.json</summary>"
         "<pre>" +
         text_of(data.config) + "</pre></details></div>\n</section>\n";
}

}  // namespace

std::string row_label(const std::string& name) {
  std::string text = name;
  std::replace(text.begin(), text.end(), '_', ' ');
  return html_escape(text);
}

std::string report_page(const ReportData& data) {
  std::string page =
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n<meta name=\"viewport\" "
      "content=\"width=device-width, initial-scale=1\"/>\n<title>" +
      text_of(data.name) + " – hsi4d</title>\n<style>" + std::string(report_style()) +
      "</style>\n</head>\n<body>\n<main>\n";
  page += head_section(data);
  if (data.summary) page += figures_section(*data.summary);
  page += errors_section(data);
  page += frames_section(data);
  page += view3d_section(data);
  if (data.summary) page += frame_errors_section(*data.summary);
  if (data.summary) page += published_section(*data.summary);
  page += losses_section(data);
  page += shares_section(data);
  page += time_section(data);
  page += notes_section(data);
  page += config_section(data);
  page += moving_data(data);
  return page + "</main>\n</body>\n</html>\n";
}

}  // namespace hsi4d
