#include "pipelines/report/figure.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "core/table.h"
#include "core/text.h"

namespace hsi4d {
namespace {

// In the units of the view box; the page scales it.
constexpr double kMostLeft = 204, kRight = 12, kTop = 10, kBottom = 38, kRowHeight = 20;
constexpr double kLetter = 6.5, kLine = 18;              // mean width of a letter; height of a line of a legend
constexpr double kGap = 26, kHeading = 20, kTitle = 34;  // of pictures: between plots, above one, above a section

/// A tick's number: as few digits as tell ticks apart.
std::string tick_text(double value) { return rounded(value, 6); }

/// Of an axis over counts: "500 k", "2 M".
std::string count_text(double value) {
  if (value < 1e4 || value >= 1e9) return tick_text(value);
  return value < 1e6 ? tick_text(value / 1e3) + " k" : tick_text(value / 1e6) + " M";
}

/// False for what has no place on an axis: so large that differences overflow; on a logarithmic scale what is not
/// above 0, or so far from 1 that ratios overflow.
bool has_place(bool is_log, double value) {
  return is_log ? value >= 1e-150 && value <= 1e150 : std::fabs(value) <= 1e300;
}
bool has_place(const Plot& plot, const std::pair<double, double>& point) {
  return has_place(plot.is_log_x, point.first) && has_place(plot.is_log, point.second);
}

struct Range {
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();
  void add(double value) {
    low = std::min(low, value);
    high = std::max(high, value);
  }
  bool empty() const { return !(low <= high); }
};

/// The step of 1, 2 or 5 times a power of ten that cuts `span` into at most `most` pieces.
double nice_step(double span, int most) {
  const double rough = span / most;
  const double power = std::pow(10, std::floor(std::log10(rough)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * power >= rough * (1 - 1e-9)) return factor * power;
  }
  return 10 * power;
}

/// An axis: where values are, and where it has ticks.
struct Axis {
  Range range;
  bool is_log = false;
  std::vector<double> ticks;

  /// 0 at the low end, 1 at the high one.
  double place(double value) const {
    if (is_log) return (std::log10(value) - std::log10(range.low)) / (std::log10(range.high) - std::log10(range.low));
    return (value - range.low) / (range.high - range.low);
  }
};

Axis linear_axis(Range range, int most_ticks, bool whole, bool round_ends) {
  Axis axis;
  if (!(range.high > range.low)) {
    const double room = std::max(std::fabs(range.low) * 0.1, whole ? 1.0 : 1e-3);
    range.high += room;
    if (range.low != 0) range.low -= room;
  }
  double step = nice_step(range.high - range.low, most_ticks);
  if (whole) step = std::max(1.0, step);
  if (round_ends) {
    range.low = std::floor(range.low / step + 1e-9) * step;
    range.high = std::ceil(range.high / step - 1e-9) * step;
  }
  axis.range = range;
  const auto first = static_cast<long long>(std::ceil(range.low / step - 1e-9));
  for (long long i = first; static_cast<double>(i) * step <= range.high + 1e-9 * step; ++i)
    axis.ticks.push_back(static_cast<double>(i) * step);
  return axis;
}

Axis log_axis(Range range) {
  Axis axis;
  axis.is_log = true;
  if (!(range.high > range.low * 1.02)) {
    range.low /= 1.2;
    range.high *= 1.2;
  }
  const double decades = std::log10(range.high / range.low);
  axis.range = {range.low / std::pow(10, 0.04 * decades), range.high * std::pow(10, 0.04 * decades)};
  if (decades < 1) {  // too narrow for powers of ten
    axis.ticks = linear_axis(axis.range, 5, false, false).ticks;
    return axis;
  }
  const int skip = decades > 7 ? static_cast<int>(decades / 6) + 1 : 1;
  for (int power = static_cast<int>(std::floor(std::log10(axis.range.low))); std::pow(10, power) <= axis.range.high;
       ++power) {
    for (const double factor : {1.0, 2.0, 5.0}) {
      const double value = factor * std::pow(10, power);
      const bool is_shown = factor == 1.0 ? power % skip == 0 : decades < 2.5;
      if (is_shown && value >= axis.range.low && value <= axis.range.high) axis.ticks.push_back(value);
    }
  }
  return axis;
}

std::string line_svg(const char* css_class, double x1, double y1, double x2, double y2) {
  return formatted(R"(<line class="%s" x1="%.1f" x2="%.1f" y1="%.1f" y2="%.1f"/>)", css_class, x1, x2, y1, y2);
}

/// @param anchor  "start", "middle" or "end": what of it stands at x
std::string text_svg(const char* css_class, const char* anchor, double x, double y, const std::string& text) {
  return formatted(R"(<text class="%s" text-anchor="%s" x="%.1f" y="%.1f">%s</text>)", css_class, anchor, x, y,
                   html_escape(text).c_str());
}

std::string dot_svg(double x, double y, double radius, const std::string& style, const std::string& tip) {
  return formatted(R"(<circle cx="%.1f" cy="%.1f" r="%.3g" style="fill:%s"><title>%s</title></circle>)", x, y, radius,
                   style.c_str(), html_escape(tip).c_str());
}

/// Entries from left to right, in as many lines as they need.
/// @param y  the top; then what is below
std::string legend_svg(const Legend& legend, double left, double right, double& y) {
  std::string svg;
  double x = right;
  for (const auto& [text, color] : legend) {
    const double width = 24 + kLetter * static_cast<double>(count_characters(text));
    if (x + width > right) x = left, y += kLine;
    svg += dot_svg(x + 5, y - 8, 4, color, text) + text_svg("entry", "start", x + 13, y - 4, text) + "\n";
    x += width;
  }
  return svg;
}

/// The axes, and where they are in the view box.
struct Area {
  Axis x, y;
  double left = 52, right = 0, top = 0, bottom = 0, height = 0;

  double at_x(double value) const { return left + x.place(value) * (right - left); }
  double at_y(double value) const { return bottom - y.place(value) * (bottom - top); }
};

Area area_of(const Plot& plot, Range xs, Range ys, double top) {
  const bool has_rows = !plot.rows.empty();
  Range& values = has_rows ? xs : ys;
  if (plot.begins_at_zero && !plot.is_log) values.add(0);
  for (const double value : plot.also)
    if (has_place(plot.is_log, value)) values.add(value);
  Area area;
  area.x = plot.is_log_x ? log_axis(xs) : linear_axis(xs, has_rows ? 4 : 8, !has_rows && plot.has_whole_x, has_rows);
  if (plot.is_log_x && !plot.ticks_x.empty()) area.x.ticks = plot.ticks_x;
  const auto rows = static_cast<double>(plot.rows.size());
  if (!plot.columns.empty()) area.x.range = {-0.3, static_cast<double>(plot.columns.size()) - 0.7};
  if (!plot.columns.empty()) area.left = kRight;
  if (!plot.columns.empty())
    area.y.range = {0, 1};
  else if (has_rows)
    area.y.range = {rows - 0.5, -0.5};
  else
    area.y = plot.is_log ? log_axis(ys) : linear_axis(ys, 5, false, true);
  std::size_t longest = 0;
  for (const std::string& row : plot.rows) longest = std::max(longest, count_characters(row));
  if (has_rows) area.left = std::min(kMostLeft, 14 + kLetter * static_cast<double>(longest));
  area.right = plot.width - kRight;
  area.top = top;
  if (!plot.columns.empty()) area.top += kLine;
  area.bottom = has_rows ? top + kRowHeight * rows : top + plot.height - kTop - kBottom;
  area.height = area.bottom + kBottom;
  if (!plot.columns.empty()) area.bottom -= kLine / 2;
  return area;
}

/// An axis for each column, named below it.
std::string columns_svg(const Plot& plot, const Area& area) {
  const auto most = static_cast<std::size_t>(0.85 * (area.at_x(1) - area.at_x(0)) / kLetter);
  std::string svg;
  for (std::size_t i = 0; i < plot.columns.size(); ++i) {
    const double x = area.at_x(static_cast<double>(i));
    svg += line_svg("axis", x, area.top, x, area.bottom) +
           text_svg("row", "middle", x, area.bottom + kBottom, shortened(plot.columns[i], most));
  }
  return svg + "\n";
}

std::string axes_svg(const Plot& plot, const Area& area) {
  if (!plot.columns.empty()) return columns_svg(plot, area);
  std::string svg;
  const bool has_rows = !plot.rows.empty();
  for (const double tick : area.y.ticks)
    svg += line_svg("grid", area.left, area.at_y(tick), area.right, area.at_y(tick)) +
           text_svg("tick", "end", area.left - 6, area.at_y(tick) + 4, tick_text(tick));
  for (std::size_t i = 0; i < plot.rows.size(); ++i)
    svg += text_svg("row", "end", area.left - 8, area.at_y(static_cast<double>(i)) + 4,
                    shortened(plot.rows[i], static_cast<std::size_t>((kMostLeft - 14) / kLetter)));
  for (const double tick : area.x.ticks) {
    if (has_rows) svg += line_svg("grid", area.at_x(tick), area.top, area.at_x(tick), area.bottom);
    svg += text_svg("tick", "middle", area.at_x(tick), area.bottom + 15,
                    plot.is_log_x ? count_text(tick) : tick_text(tick));
  }
  if (!has_rows) svg += line_svg("axis", area.left, area.bottom, area.right, area.bottom);
  if (has_rows && plot.begins_at_zero) svg += line_svg("axis", area.at_x(0), area.top, area.at_x(0), area.bottom);
  if (plot.is_timed)
    svg += formatted(R"(<line class="now" visibility="hidden" x1="0" x2="0" y1="%.1f" y2="%.1f"/>)", area.top,
                     area.bottom);
  return svg + text_svg("tick", "middle", (area.left + area.right) / 2, area.bottom + 33, plot.x_label) + "\n";
}

/// The tooltip of a dot: of rows the label has all.
std::string tip_of(const Plot& plot, const Series& series, const std::pair<double, double>& point) {
  if (!plot.rows.empty() || !plot.columns.empty()) return series.label;
  return series.label + ", " + plot.x_label + " " + tick_text(point.first) + ": " +
         fixed_number(point.second, plot.decimals) + (plot.unit.empty() ? "" : " " + plot.unit);
}

std::string series_svg(const Plot& plot, const Series& series, const Area& area) {
  std::string points, dots;
  double first_x = 0, x = 0, y = 0;
  const std::string opacity = series.opacity < 1 ? ";opacity:" + fixed_number(series.opacity, 2) : "";
  for (const auto& point : series.points) {
    if (!has_place(plot, point)) continue;
    x = area.at_x(point.first), y = area.at_y(point.second);
    if (points.empty()) first_x = x;
    points += formatted("%s%.1f,%.1f", points.empty() ? "" : " ", x, y);
    if (series.dots > 0) dots += dot_svg(x, y, series.dots, series.color + opacity, tip_of(plot, series, point));
  }
  if (points.empty()) return "";
  std::string svg;
  if (series.is_area)
    svg = formatted(R"(<polygon points="%.1f,%.1f %s %.1f,%.1f" style="fill:%s%s"><title>%s</title></polygon>)",
                    first_x, area.bottom, points.c_str(), x, area.bottom, series.color.c_str(), opacity.c_str(),
                    html_escape(series.label).c_str());
  else if (series.line > 0)
    svg = formatted(R"(<polyline points="%s" style="stroke:%s;stroke-width:%.3g%s%s"><title>%s</title></polyline>)",
                    points.c_str(), series.color.c_str(), series.line, opacity.c_str(),
                    series.is_dashed ? ";stroke-dasharray:5 4" : "", html_escape(series.label).c_str());
  svg += dots;
  const bool is_at_right = x > 0.75 * plot.width;  // where the name would not fit beside it
  if (series.name != Series::Name::kNone)
    svg += text_svg("name", is_at_right ? "end" : "start", is_at_right ? x - 5 : x + 5,
                    y + (series.name == Series::Name::kBelow ? 11 : -4), series.label);
  return svg + "\n";
}

/// The plot's element, at a place of a picture; empty where there is nothing to plot.
/// @param height  what it has
std::string placed_svg(const Plot& plot, double left, double top, double& height) {
  Range xs, ys;
  for (const Series& series : plot.series) {
    for (const auto& point : series.points) {
      if (!has_place(plot, point)) continue;
      xs.add(point.first);
      ys.add(point.second);
    }
  }
  if (xs.empty()) return "";
  double below = 0;
  std::string inside = "\n" + legend_svg(plot.legend, 8, plot.width, below);
  const Area area = area_of(plot, xs, ys, below + kTop);
  inside += axes_svg(plot, area);
  for (const Series& series : plot.series) inside += series_svg(plot, series, area);
  height = area.height;
  return formatted(R"(<svg class="%s" data-from="%.1f" data-to="%.1f" data-left="%.1f" data-right="%.1f" )",
                   plot.is_timed ? "plot timed" : "plot", area.x.range.low, area.x.range.high, area.left, area.right) +
         formatted(R"(x="%.1f" y="%.1f" width="%.1f" height="%.1f" viewBox="0 0 %.1f %.1f" )", left, top, plot.width,
                   height, plot.width, height) +
         "role=\"img\" aria-label=\"" + html_escape(plot.title) + "\">" + inside + "</svg>";
}

constexpr const char* kPictureStyle =
    "<style>text{font-size:12px;fill:#222}.title{font-size:16px}.heading{font-weight:bold}.plot text{fill:#555}"
    ".plot .name{font-size:10px;fill:#222}.plot .entry,.plot .row{fill:#222}.plot .grid{stroke:#e4e4e4}"
    ".plot .axis{stroke:#888}.plot polyline{fill:none}</style>\n";

/// @param y  where it begins; then where it ends
std::string section_svg(const PictureSection& section, double width, double& y) {
  std::string svg = text_svg("title", "start", kGap + 8, y + 18, section.title) + "\n";
  y += kTitle;
  if (!section.note.empty()) {
    svg += text_svg("note", "start", kGap + 8, y + 6, section.note) + "\n";
    y += kLine;
  }
  svg += legend_svg(section.legend, kGap + 8, width, y);
  if (!section.legend.empty()) y += kGap / 4;
  double tallest = 0;
  for (std::size_t i = 0; i < section.plots.size(); ++i) {
    const Plot& plot = section.plots[i];
    const auto column = static_cast<double>(i % section.columns);
    if (column == 0) y += std::exchange(tallest, 0);
    const double x = kGap + column * (plot.width + kGap);
    double height = 0;
    const std::string drawn = placed_svg(plot, x, y + kHeading, height);
    svg += text_svg("heading", "start", x + 8, y + 14, plot.title + (drawn.empty() ? ": nothing to plot" : "")) + "\n" +
           drawn + "\n";
    tallest = std::max(tallest, kHeading + height + kGap / 2);
  }
  y += tallest;
  return svg;
}

}  // namespace

std::string plot_svg(const Plot& plot) {
  double height = 0;
  const std::string svg = placed_svg(plot, 0, 0, height);
  return svg.empty() ? "<p class=\"nothing\">There is nothing to plot.</p>" : svg;
}

std::string picture_svg(const std::vector<PictureSection>& sections) {
  double width = 0, height = kGap / 2;
  for (const PictureSection& section : sections) {
    const auto columns = static_cast<double>(std::min(section.plots.size(), section.columns));
    for (const Plot& plot : section.plots) width = std::max(width, kGap + columns * (plot.width + kGap));
  }
  std::string body;
  for (const PictureSection& section : sections) body += section_svg(section, width, height);
  const std::string size = formatted(R"(width="%.1f" height="%.1f")", width, height);
  return formatted(R"(<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 %.1f %.1f" )", width, height) + size +
         " font-family=\"sans-serif\">\n" + kPictureStyle + "<rect " + size + " fill=\"#fff\"/>\n" + body + "</svg>\n";
}

Plot bar_plot(const std::string& title, const std::string& unit, const std::vector<BarPart>& parts, double named) {
  Plot plot{.title = title, .x_label = unit, .unit = unit, .series = {}, .rows = {""}, .begins_at_zero = true};
  double total = 0, at = 0;
  for (const BarPart& part : parts) total += part.value;
  for (const auto& [name, value, color] : parts) {
    const std::string label = name + " " + rounded(value, 3) + " " + unit;
    if (value > 0)
      plot.series.push_back({.label = label + ", " + fixed_number(100 * value / total, 1) + " %",
                             .color = color,
                             .points = {{at, 0}, {at + value, 0}},
                             .line = kRowHeight - 4});
    if (value > 0 && value >= named * total) plot.legend.emplace_back(label, color);
    at += value;
  }
  return plot;
}

std::string part_color(size_t i) {
  constexpr std::array<const char*, 12> kColors = {"#3b82c4", "#d98a2b", "#3f9d6b", "#b4579a", "#7a6fc9", "#c2553f",
                                                   "#4aa5a8", "#8b8f3a", "#7d4a1f", "#e7a6c8", "#1d4f6e", "#9fce5a"};
  return kColors[i % kColors.size()];
}

}  // namespace hsi4d
