#include "pipelines/report/plots.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/text.h"
#include "pipelines/record/summary.h"

namespace hsi4d {
namespace {

// In the units of the view box; the page scales it.
constexpr double kHeight = 210;
constexpr double kLeft = 52, kRight = 12, kTop = 10, kBottom = 38;

/// Length of the UTF-8 character that begins at text[i]; 0 where none does.
size_t utf8_length(const std::string& text, size_t i) {
  const auto byte = [&text](size_t at) { return static_cast<unsigned char>(at < text.size() ? text[at] : 0); };
  const unsigned first = byte(i);
  const size_t length = first < 0x80                    ? 1
                        : first >= 0xC2 && first < 0xE0 ? 2
                        : first >= 0xE0 && first < 0xF0 ? 3
                        : first >= 0xF0 && first < 0xF5 ? 4
                                                        : 0;
  for (size_t k = 1; k < length; ++k) {
    if ((byte(i + k) & 0xC0U) != 0x80U) return 0;
  }
  return length;
}

std::string coordinate(double value) { return fixed_number(value, 1); }

/// A tick's number: as few digits as tell ticks apart.
std::string tick_text(double value) { return rounded(value, 6); }

/// Of an axis over counts: "500 k", "2 M".
std::string count_text(double value) {
  if (value < 1e4 || value >= 1e9) return tick_text(value);
  return value < 1e6 ? tick_text(value / 1e3) + " k" : tick_text(value / 1e6) + " M";
}

/// False for what has no place on the axes: so large that differences overflow; on a logarithmic scale what is not
/// above 0, or so far from 1 that ratios overflow.
bool has_place(const Plot& plot, double y) { return plot.is_log ? y >= 1e-150 && y <= 1e150 : std::fabs(y) <= 1e300; }

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
  const int skip = decades > 7 ? static_cast<int>(decades / 6) + 1 : 1;
  for (int power = static_cast<int>(std::floor(std::log10(axis.range.low)));
       power <= static_cast<int>(std::ceil(std::log10(axis.range.high))); ++power) {
    for (const double factor : {1.0, 2.0, 3.0, 5.0, 7.0}) {
      const bool is_shown = factor == 1.0                    ? power % skip == 0
                            : factor == 2.0 || factor == 5.0 ? decades < 2.5
                                                             : decades < 0.8;
      const double value = factor * std::pow(10, power);
      if (is_shown && value >= axis.range.low && value <= axis.range.high) axis.ticks.push_back(value);
    }
  }
  if (axis.ticks.empty()) return linear_axis(range, 4, false, false);  // a range too narrow for round numbers
  return axis;
}

double plot_x(const Plot& plot, const Axis& axis, double x) {
  return kLeft + axis.place(x) * (plot.width - kLeft - kRight);
}
double plot_y(const Axis& axis, double y) { return kHeight - kBottom - axis.place(y) * (kHeight - kTop - kBottom); }

void append_axes(std::string& svg, const Plot& plot, const Axis& x, const Axis& y) {
  const std::string left = coordinate(kLeft), right = coordinate(plot.width - kRight),
                    floor = coordinate(kHeight - kBottom);
  for (const double tick : y.ticks) {
    const double at = plot_y(y, tick);
    svg += "<line class=\"grid\" x1=\"" + left + "\" x2=\"" + right + "\" y1=\"" + coordinate(at) + "\" y2=\"" +
           coordinate(at) + "\"/><text class=\"tick\" text-anchor=\"end\" x=\"" + coordinate(kLeft - 6) + "\" y=\"" +
           coordinate(at + 4) + "\">" + tick_text(tick) + "</text>";
  }
  for (const double tick : x.ticks)
    svg += "<text class=\"tick\" text-anchor=\"middle\" x=\"" + coordinate(plot_x(plot, x, tick)) + "\" y=\"" +
           coordinate(kHeight - kBottom + 15) + "\">" + (plot.is_log_x ? count_text(tick) : tick_text(tick)) +
           "</text>";
  svg += "<line class=\"axis\" x1=\"" + left + "\" x2=\"" + right + "\" y1=\"" + floor + "\" y2=\"" + floor + "\"/>";
  svg += "<text class=\"tick\" text-anchor=\"middle\" x=\"" + coordinate((kLeft + plot.width - kRight) / 2) +
         "\" y=\"" + coordinate(kHeight - 5) + "\">" + html_escape(plot.x_label) + "</text>\n";
}

void append_line(std::string& svg, const Plot& plot, const PlotLine& line, const Axis& x, const Axis& y) {
  std::string points, dots, name;
  for (const auto& [px, py] : line.points) {
    if (!has_place(plot, py)) continue;
    const std::string at_x = coordinate(plot_x(plot, x, px)), at_y = coordinate(plot_y(y, py));
    points += (points.empty() ? "" : " ") + at_x + "," + at_y;
    if (line.is_named) {
      const double at = plot_x(plot, x, px);
      const bool is_right = at > 0.75 * plot.width;  // where the label would not fit beside it
      name = std::string("<text class=\"name\"") + (is_right ? " text-anchor=\"end\"" : "") + " x=\"" +
             coordinate(is_right ? at - 5 : at + 5) + "\" y=\"" +
             coordinate(plot_y(y, py) + (line.name_is_below ? 11 : -4)) + "\">" + html_escape(line.label) + "</text>";
    }
    if (line.has_dots)
      dots += "<circle cx=\"" + at_x + "\" cy=\"" + at_y + "\" r=\"3\" style=\"fill:" + line.color + "\"><title>" +
              html_escape(line.label) + ", " + html_escape(plot.x_label) + " " + tick_text(px) + ": " +
              fixed_number(py, plot.decimals) + (plot.unit.empty() ? "" : " " + html_escape(plot.unit)) +
              "</title></circle>";
  }
  if (points.empty()) return;
  svg += "<polyline points=\"" + points + "\" style=\"stroke:" + line.color;
  if (line.opacity < 1) svg += ";opacity:" + fixed_number(line.opacity, 2);
  if (line.is_dashed) svg += ";stroke-dasharray:5 4";
  svg += "\"><title>" + html_escape(line.label) + "</title></polyline>" + dots + name + "\n";
}

/// The rest of the class, and where which frame is: from which to which, and at which x these are.
std::string timed_attributes(const Plot& plot, const Axis& x) {
  return " timed\" data-from=\"" + coordinate(x.range.low) + "\" data-to=\"" + coordinate(x.range.high) +
         "\" data-left=\"" + coordinate(plot_x(plot, x, x.range.low)) + "\" data-right=\"" +
         coordinate(plot_x(plot, x, x.range.high)) + "\"";
}

}  // namespace

std::string html_escape(const std::string& text) {
  std::string out;
  for (size_t i = 0; i < text.size();) {
    const size_t length = utf8_length(text, i);
    const auto first = static_cast<unsigned char>(text[i]);
    const bool is_control = (first < 0x20 && first != '\n' && first != '\t') || first == 0x7F;
    if (length == 0 || is_control) {
      out += "\xEF\xBF\xBD";
      ++i;
      continue;
    }
    switch (text[i]) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      case '\'':
        out += "&#39;";
        break;
      default:
        out.append(text, i, length);
    }
    i += length;
  }
  return out;
}

std::string plot_svg(const Plot& plot) {
  Range xs, ys;
  for (const PlotLine& line : plot.lines) {
    for (const auto& [x, y] : line.points) {
      if (!has_place(plot, y)) continue;
      xs.add(x);
      ys.add(y);
    }
  }
  if (xs.empty()) return "<p class=\"nothing\">There is nothing to plot.</p>";
  if (plot.begins_at_zero && !plot.is_log) ys.add(0);
  for (const double y : plot.also_y)
    if (has_place(plot, y)) ys.add(y);
  Axis x = plot.is_log_x ? log_axis(xs) : linear_axis(xs, 8, plot.has_whole_x, false);
  if (plot.is_log_x) x.ticks = plot.ticks_x;
  const Axis y = plot.is_log ? log_axis(ys) : linear_axis(ys, 5, false, true);
  std::string svg = "<svg class=\"plot" + (plot.is_timed ? timed_attributes(plot, x) : "\"") + plot.attributes +
                    " role=\"img\" viewBox=\"0 0 " + fixed_number(plot.width, 0) + " " + fixed_number(kHeight, 0) +
                    "\" aria-label=\"" + html_escape(plot.title) + "\">\n";
  append_axes(svg, plot, x, y);
  if (plot.is_timed)
    svg += "<line class=\"now\" visibility=\"hidden\" x1=\"0\" x2=\"0\" y1=\"" + coordinate(kTop) + "\" y2=\"" +
           coordinate(kHeight - kBottom) + "\"/>";
  for (const PlotLine& line : plot.lines) append_line(svg, plot, line, x, y);
  return svg + "</svg>";
}

std::string share_bar_svg(const std::string& title, const std::vector<std::pair<std::string, double>>& parts) {
  double total = 0;
  for (const auto& [name, value] : parts) total += value;
  if (!(total > 0)) return "";
  std::string svg =
      "<svg class=\"bar\" role=\"img\" viewBox=\"0 0 1000 28\" preserveAspectRatio=\"none\" aria-label=\"" +
      html_escape(title) + "\">";
  double at = 0;
  for (size_t i = 0; i < parts.size(); ++i) {
    const double width = 1000 * parts[i].second / total;
    svg += "<rect x=\"" + coordinate(at) + "\" y=\"0\" height=\"28\" width=\"" + coordinate(width) +
           "\" style=\"fill:" + part_color(i) + "\"><title>" + html_escape(parts[i].first) + ": " +
           fixed_number(100 * parts[i].second / total, 1) + " %</title></rect>";
    at += width;
  }
  return svg + "</svg>";
}

std::string part_color(size_t i) {
  constexpr std::array<const char*, 12> kColors = {"#3b82c4", "#d98a2b", "#3f9d6b", "#b4579a", "#7a6fc9", "#c2553f",
                                                   "#4aa5a8", "#8b8f3a", "#7d4a1f", "#e7a6c8", "#1d4f6e", "#9fce5a"};
  return kColors[i % kColors.size()];
}

}  // namespace hsi4d
