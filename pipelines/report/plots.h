// Line plots as SVG text, to stand inside of a page that styles them.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace hsi4d {

/// `text` as HTML text or attribute: & < > " ' escaped, control characters and bytes that are no UTF-8 replaced.
std::string html_escape(const std::string& text);

struct PlotLine {
  std::string label;  ///< in tooltips
  std::string color;  ///< CSS, of this program's making
  std::vector<std::pair<double, double>> points;
  bool is_dashed = false;
  bool has_dots = false;  ///< a dot with a tooltip at every point
  double opacity = 1;     ///< of the line; 0: dots alone
  bool is_named = false;  ///< its label stands beside its last point, above or
  bool name_is_below = false;
};

struct Plot {
  std::string title;    ///< for screen readers
  std::string x_label;  ///< under the axis
  std::string unit;     ///< of y, in tooltips
  std::vector<PlotLine> lines;
  bool is_log = false;    ///< y on a logarithmic scale; points ≤ 0 are left out
  bool is_log_x = false;  ///< x on a logarithmic scale with ticks at ticks_x; all x > 0
  std::vector<double> ticks_x{};
  bool begins_at_zero = false;   ///< y, unless it is logarithmic
  std::vector<double> also_y{};  ///< what the axis of y reaches beside the points, so that plots have one in common
  bool has_whole_x = true;       ///< x ticks at whole numbers only
  int decimals = 2;              ///< of y in tooltips
  bool is_timed = false;         ///< x is the frame, of which the page's script marks the one that is looked at
  double width = 380;            ///< in the units of the view box, where letters are 12 high; the page scales it
  std::string attributes{};      ///< more of the element's attributes, of this program's making
};

/// The plot as one <svg> element; a few words instead where there is nothing to plot.
std::string plot_svg(const Plot& plot);

/// A bar of named parts, each as wide as its share. Values ≥ 0.
std::string share_bar_svg(const std::string& title, const std::vector<std::pair<std::string, double>>& parts);

/// The colour of part i, CSS; colours repeat after twelve.
std::string part_color(size_t i);

}  // namespace hsi4d
