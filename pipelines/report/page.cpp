#include "pipelines/report/page.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/progress.h"
#include "pipelines/record/gradient_table.h"
#include "pipelines/report/assets.h"
#include "pipelines/report/figure.h"
#include "pipelines/report/published.h"

namespace hsi4d {
namespace {

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
  return "<span class=\"badge " + (is_known ? data.state : "unknown") + "\">" + html_escape(shown) + "</span>";
}

std::string head_section(const ReportData& data) {
  std::string text = "<header><h1>" + html_escape(data.name) + "</h1>" + state_badge(data) + "</header>\n";
  if (data.is_orphaned)
    text +=
        "<p class=\"message\">Its status says that it is running, but no process writes this folder any more: it "
        "was killed, or this is a copy.</p>\n";
  if (!data.message.empty()) text += "<p class=\"message\">" + html_escape(data.message) + "</p>\n";
  text += "<dl class=\"facts\">\n";
  for (const auto& [label, value] : data.facts)
    text += "<div><dt>" + html_escape(label) + "</dt><dd>" + html_escape(value) + "</dd></div>\n";
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
                          std::initializer_list<std::string_view> skipped = {}) {
  const MetricValues& values = summary.metrics.back().values;
  std::string worse;
  for (const MetricFacts& facts : metric_facts()) {
    const bool is_skipped = std::find(skipped.begin(), skipped.end(), facts.name) != skipped.end();
    if (!is_skipped && is_worse(facts, values, baseline) && !is_redeemed(facts, values, baseline))
      worse += (worse.empty() ? "" : "; ") + std::string(facts.label);
  }
  return worse.empty() ? "" : "<p class=\"message\">Worse than " + name + ": " + html_escape(worse) + ".</p>\n";
}

/// Whether a baseline is one pose in all frames, as the start is where only frame 0 is given.
bool stands_still(const MetricValues& baseline) {
  const auto is_none = [&](const char* name) {
    const double* const value = find_metric(baseline, name);
    return value == nullptr || *value == 0;
  };
  return is_none("jitter") && is_none("floor_drift_mm") && is_none("foot_sliding_mm");
}

/// Against both baselines. What stands still does not tremble, slide or drift: that is no merit.
std::string worse_messages(const RunSummary& summary) {
  std::string text;
  for (const auto& [name, shown] : {std::pair("start", "the start"), {"copy_frame_0", "frame 0 copied"}}) {
    const MetricValues* const baseline = baseline_values(summary, name);
    if (baseline == nullptr) continue;
    text += stands_still(*baseline)
                ? worse_message(summary, *baseline, shown, {"jitter", "floor_drift_mm", "foot_sliding_mm"})
                : worse_message(summary, *baseline, shown);
  }
  return text;
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
             html_escape(facts.summary) + "\"><div class=\"label\">" + html_escape(facts.label) +
             "</div><div class=\"value\">" + fixed_number(*value, facts.decimals) + " <small>" +
             html_escape(facts.unit) + "</small></div><div class=\"before\">" +
             (before == nullptr || facts.better == 0 ? "" : change_text(facts, *value, *before)) + "</div></div>\n";
  }
  if (cards.empty()) return "";
  return worse_messages(summary) + "<div class=\"figures\">\n" + cards + "</div>\n";
}

// ---- Errors ----

/// Names in the head and the first column as they are for people.
Table with_labels(Table table) {
  for (Cell& cell : table.head) cell.html = row_label(cell.text);
  for (auto& row : table.rows)
    if (row[0].html.empty()) row[0].html = row_label(row[0].text);
  return table;
}

/// The people beside the first one; empty where there are none.
std::string people_errors(const RunSummary& summary) {
  Table table = people_table(summary);
  if (table.rows.empty()) return "";
  table.head[0] = "error";
  return "<div class=\"card wide\">" + table_html(with_labels(std::move(table)), "errors") +
         "</div>\n<p class=\"caption\">The people beside the first one: what they began with, in grey, and the "
         "result.</p>\n";
}

std::string errors_section(const ReportData& data) {
  std::string text = "<section id=\"errors\">\n<h2>Errors</h2>\n";
  Table table = data.summary ? error_table(*data.summary) : Table();
  if (table.rows.empty()) return text + "<p class=\"nothing\">No errors were measured.</p>\n</section>\n";
  table.head[0] = "error";
  std::string of_frame_0;
  const auto add = [&of_frame_0](const std::string& name) {
    of_frame_0 += (of_frame_0.empty() ? " Of frame 0 alone, and compared with each other: " : ", ") + row_label(name);
  };
  for (const Baseline& baseline : data.summary->baselines)
    if (baseline.of_frame_0) add(baseline.name);
  for (const StageSummary& stage : data.summary->metrics)
    if (stage.of_frame_0) add(stage.stage);
  return text + "<div class=\"card wide\">" + table_html(with_labels(std::move(table)), "errors") +
         "</div>\n<p class=\"caption\">Means over the frames that were optimised; columns in grey are "
         "what no optimisation gives, the others the end of each stage. The best of each row is "
         "marked." +
         of_frame_0 + (of_frame_0.empty() ? "" : ".") + "</p>\n" + people_errors(*data.summary) + "</section>\n";
}

// ---- Errors by frame ----

Series frame_line(const std::string& label, const std::string& color, const std::vector<FrameMetrics>& frames,
                  std::string_view metric) {
  Series line{.label = label, .color = color, .points = {}, .dots = 3};
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
Series baseline_line(const Baseline& baseline, const RunSummary& summary, std::string_view metric) {
  Series line = frame_line(baseline.name, baseline_color(baseline), baseline.per_frame, metric);
  const double* const mean = find_metric(baseline.values, metric);
  if (!line.points.empty() || mean == nullptr) return line;
  line.label += " (mean)";
  line.is_dashed = true;
  line.dots = 0;
  for (const FrameMetrics* const end : {&summary.per_frame.front(), &summary.per_frame.back()})
    line.points.emplace_back(end->frame, *mean);
  return line;
}

/// How sure the run says that it is, under an error of the same kind: errors up to it are as it says.
std::optional<Series> sigma_band(const RunSummary& summary, std::string_view error) {
  const bool is_object = error == "object_translation_cm";
  const bool is_depth = error == "world_mpjpe_depth_mm";
  if (!is_object && !is_depth && error != "world_mpjpe_image_mm") return std::nullopt;
  const std::string before = is_object ? "object_" : "", unit = is_object ? "_cm" : "_mm";
  Series band{.label = "claimed sigma", .color = "var(--result)", .points = {}, .opacity = 0.18, .is_area = true};
  for (const FrameMetrics& frame : summary.per_frame) {
    const double* const across = find_metric(frame.values, before + "sigma_image" + unit);
    const double* const along = find_metric(frame.values, before + "sigma_depth" + unit);
    if (across == nullptr || along == nullptr) continue;
    const double in_image = std::sqrt(2.0) * *across;  // of both axes
    band.points.emplace_back(frame.frame, is_object ? std::hypot(in_image, *along) : is_depth ? *along : in_image);
  }
  return band.points.empty() ? std::nullopt : std::optional(band);
}

bool has_sigmas(const RunSummary& summary) {
  return std::any_of(summary.per_frame.begin(), summary.per_frame.end(),
                     [](const FrameMetrics& frame) { return find_metric(frame.values, "sigma_depth_mm") != nullptr; });
}

std::string frame_errors_legend(const RunSummary& summary) {
  std::string text = "<p class=\"legend\">";
  for (const Baseline& baseline : summary.baselines) {
    if (baseline.of_frame_0) continue;
    text += "<span><span class=\"key" + std::string(baseline.per_frame.empty() ? " dashed" : "") +
            "\" style=\"border-color:" + baseline_color(baseline) + "\"></span>" + row_label(baseline.name) +
            (baseline.per_frame.empty() ? ", mean" : "") + "</span>";
  }
  if (!summary.first_pass.empty())
    text += "<span><span class=\"key\" style=\"border-color:var(--first)\"></span>first pass</span>";
  text += "<span><span class=\"key\" style=\"border-color:var(--result)\"></span>result</span>";
  if (has_sigmas(summary))
    text += "<span><span class=\"box\" style=\"background:var(--result);opacity:0.18\"></span>claimed sigma</span>";
  return text + "</p>\n";
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
    const Series result = frame_line("result", "var(--result)", summary.per_frame, facts.name);
    if (result.points.empty()) continue;
    if (const std::optional<Series> band = sigma_band(summary, facts.name)) plot.series.push_back(*band);
    for (const Baseline& baseline : summary.baselines) {
      if (!baseline.of_frame_0) plot.series.push_back(baseline_line(baseline, summary, facts.name));
    }
    const Series first = frame_line("first pass", "var(--first)", summary.first_pass, facts.name);
    if (!first.points.empty()) plot.series.push_back(first);
    plot.series.push_back(result);
    cards += "<div class=\"card\" title=\"" + html_escape(facts.summary) + "\"><h3>" + html_escape(facts.label) +
             (facts.unit.empty() ? "" : " [" + html_escape(facts.unit) + "]") + "</h3>" + plot_svg(plot) + "</div>\n";
  }
  if (cards.empty()) return "";
  return "<section id=\"errors-by-frame\">\n<h2>Errors by frame</h2>\n" + frame_errors_legend(summary) +
         "<div class=\"plots\">\n" + cards + "</div>\n</section>\n";
}

// ---- How sure places are ----

/// By object and joint; empty where the run does not say it.
std::string places_section(const std::vector<PlaceRow>& places) {
  if (places.empty()) return "";
  const bool has_unsure = std::any_of(places.begin(), places.end(), [](const PlaceRow& row) { return row.unsure > 0; });
  Table table{.head = {"place", "across the view", "along it"}, .align = "lr"};
  if (has_unsure) table.head.emplace_back("unsure");
  for (const PlaceRow& row : places) {
    const auto millimetres = [&row](double metres) { return row.sure == 0 ? kNoCell : Cell(1e3 * metres, 1); };
    std::vector<Cell> cells = {row.name, millimetres(row.across), millimetres(row.along)};
    cells[0].html = row_label(row.name);
    if (has_unsure) cells.emplace_back(std::to_string(row.unsure) + " of " + std::to_string(row.sure + row.unsure));
    table.rows.push_back(std::move(cells));
  }
  std::string text = "<section id=\"places\">\n<h2>How sure places are</h2>\n<div class=\"card wide\">" +
                     table_html(table, "errors") +
                     "</div>\n<p class=\"caption\">The claimed sigma, one standard deviation in millimetres along an "
                     "axis of the image and along the camera's: means over the frames, of the objects' centroids and "
                     "of the joints.";
  if (has_unsure) text += " Frames at which it is 1 m or more are counted as unsure, and left out of the means.";
  return text + "</p>\n</section>\n";
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
      plot.series.push_back({.label = curve_name(curve),
                             .color = ramp_color(i, stage.curves.size()),
                             .points = thinned(curve.points),
                             .opacity = stage.curves.size() > 12 ? 0.6 : 0.9});
    }
    text += "<div class=\"card\"><h3>" + row_label(stage.stage) + "</h3>" + ramp_legend(stage) + plot_svg(plot) +
            loss_caption(stage) + "</div>\n";
  }
  return text + "</div>\n</section>\n";
}

// ---- Shares of the gradient ----

std::string shares_section(const ReportData& data) {
  if (!data.summary) return "";
  std::string cards;
  for (const StageSummary& stage : data.summary->metrics) {
    if (stage.gradient_shares.empty()) continue;
    cards += "<div class=\"card wide\"><h3>" + row_label(stage.stage) + "</h3>" +
             table_html(with_labels(shares_table("group", stage.gradient_shares))) + "</div>\n";
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
  std::vector<BarPart> parts;
  for (const TimeRow& row : rows) parts.push_back({row.name, row.seconds, part_color(parts.size())});
  Plot bar = bar_plot("time by stage", "s", parts, 2);
  bar.width = 1140;
  const std::vector<std::string> counters = counter_names(rows);
  Table table{.head = {"stage", "seconds", "share", "iterations", "ms an iteration"}};
  table.head.insert(table.head.end(), counters.begin(), counters.end());
  for (size_t i = 0; i < rows.size(); ++i) {
    const TimeRow& row = rows[i];
    const auto iterations = static_cast<double>(row.iterations);
    std::vector<Cell> cells = {row.name, Cell(row.seconds, 2), fixed_number(100 * row.seconds / total, 1) + " %"};
    cells.push_back(row.iterations == 0 ? kNoCell : Cell(counter_text(iterations)));
    cells.push_back(row.iterations == 0 ? kNoCell : Cell(1000 * row.seconds / iterations, 2));
    for (const std::string& name : counters) {
      const double* const value = row.values == nullptr ? nullptr : find_metric(*row.values, name);
      cells.push_back(value == nullptr ? kNoCell : Cell(counter_text(*value)));
    }
    table.rows.push_back(std::move(cells));
  }
  table = with_labels(std::move(table));
  for (size_t i = 0; i < rows.size(); ++i)
    table.rows[i][0].html =
        "<span class=\"box\" style=\"background:" + part_color(i) + "\"></span>" + table.rows[i][0].html;
  return "<section id=\"time\">\n<h2>Time</h2>\n" + plot_svg(bar) + "\n<div class=\"card wide\">" + table_html(table) +
         "</div>\n</section>\n";
}

// ---- The rest ----

std::string notes_section(const ReportData& data) {
  if (data.notes.empty()) return "";
  std::string text = "<section id=\"notes\">\n<h2>Notes</h2>\n<div class=\"card\"><ul class=\"notes\">\n";
  for (const std::string& note : data.notes) text += "<li>" + html_escape(note) + "</li>\n";
  return text + "</ul></div>\n</section>\n";
}

std::string config_section(const ReportData& data) {
  if (data.config.empty()) return "";
  return "<section id=\"config\">\n<h2>Settings</h2>\n<div "
         "class=\"card\"><details><summary>config.resolved.json</summary>"
         "<pre>" +
         html_escape(data.config) + "</pre></details></div>\n</section>\n";
}

}  // namespace

std::string row_label(const std::string& name) {
  std::string text = name;
  std::replace(text.begin(), text.end(), '_', ' ');
  return html_escape(text);
}

std::string report_page(const ReportData& data) {
  std::string page = head_section(data);
  if (data.summary) page += figures_section(*data.summary);
  page += errors_section(data);
  if (data.summary) page += table_section(quality_table(data.summary->quality));
  page += frames_section(data);
  page += view3d_section(data);
  if (data.summary) page += frame_errors_section(*data.summary);
  page += places_section(data.places);
  if (data.summary) page += published_section(*data.summary);
  page += losses_section(data);
  page += shares_section(data);
  page += time_section(data);
  page += notes_section(data);
  page += config_section(data);
  page += moving_data(data);
  return html_page(data.name + " – hsi4d", page);
}

std::string html_page(const std::string& title, const std::string& body) {
  return "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n<meta name=\"viewport\" "
         "content=\"width=device-width, initial-scale=1\"/>\n<title>" +
         html_escape(title) + "</title>\n<style>" + std::string(report_style()) +
         "</style>\n</head>\n<body>\n<main>\n" + body + "</main>\n</body>\n</html>\n";
}

std::string table_section(const Table& table) {
  if (table.rows.empty() || table.head.size() < 2) return "";
  return "<section><h2>" + html_escape(table.title) + "</h2>\n<p class=\"caption\">" + html_escape(table.caption) +
         ".</p>\n<div class=\"card wide\">" + table_html(table, "errors") + "</div></section>\n";
}

std::string plots_section(const std::string& title, const std::string& caption,
                          const std::vector<std::pair<std::string, std::string>>& plots) {
  std::string cards;
  for (const auto& [heading, plot] : plots)
    if (!plot.empty()) cards += "<div class=\"card\"><h3>" + html_escape(heading) + "</h3>" + plot + "</div>\n";
  if (cards.empty()) return "";
  return "<section><h2>" + html_escape(title) + "</h2>\n" +
         (caption.empty() ? "" : "<p class=\"caption\">" + html_escape(caption) + "</p>\n") +
         "<div class=\"plots\">\n" + cards + "</div></section>\n";
}

}  // namespace hsi4d
