// Plots as SVG text: to stand inside of a page that styles them, or side by side in a file of their own.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace hsi4d {

/// Points of one kind: a line through them, dots, or both. A thick line of two points is a bar.
struct Series {
  std::string label;  ///< in tooltips
  std::string color;  ///< CSS, of this program's making
  std::vector<std::pair<double, double>> points;
  double line = 1.8;  ///< width; 0: none
  double dots = 0;    ///< radius of a dot with a tooltip at every point
  double opacity = 1;
  bool is_dashed = false;
  bool is_area = false;  ///< all below the line is filled, in place of a line
  enum class Name { kNone, kAbove, kBelow };
  Name name = Name::kNone;  ///< where its label stands beside its last point
};

/// Words, and the colour of a dot before them.
using Legend = std::vector<std::pair<std::string, std::string>>;

struct Plot {
  std::string title;    ///< for screen readers; in a picture, above it
  std::string x_label;  ///< under the axis
  std::string unit;     ///< of y, in tooltips
  std::vector<Series> series;
  Legend legend{};                     ///< above the axes
  std::vector<std::string> rows{};     ///< y is not a number but a row, 0 the topmost one; these name them
  std::vector<std::string> columns{};  ///< x is a column, an axis of its own with y from 0 to 1; these name them
  bool is_log = false;                 ///< y on a logarithmic scale; points ≤ 0 are left out
  bool is_log_x = false;               ///< x likewise
  std::vector<double> ticks_x{};       ///< of a logarithmic x; empty: round numbers
  bool begins_at_zero = false;         ///< y, unless it is logarithmic; x where there are rows
  std::vector<double> also{};          ///< what that axis reaches beside the points, so that plots have one in common
  bool has_whole_x = true;             ///< x ticks at whole numbers only
  int decimals = 2;                    ///< of y in tooltips
  bool is_timed = false;               ///< x is the frame, of which the page's script marks the one that is looked at
  double width = 380;                  ///< in the units of the view box, where letters are 12 high; the page scales it
  double height = 210;                 ///< of the axes with their labels; rows have a height of their own
};

/// The plot as one <svg> element; a few words instead where there is nothing to plot.
std::string plot_svg(const Plot& plot);

/// The size of a plot in a picture.
inline constexpr double kPanelWidth = 460, kPanelHeight = 254;

/// Plots of one width under a title, so many beside one another.
struct PictureSection {
  std::string title = {}, note = {};
  Legend legend = {};
  std::vector<Plot> plots = {};
  std::size_t columns = 2;
};

/// Sections below one another as an SVG file.
std::string picture_svg(const std::vector<PictureSection>& sections);

/// The colour of part i, CSS; colours repeat after twelve.
std::string part_color(size_t i);

/// A part of a bar, ≥ 0.
struct BarPart {
  std::string name;
  double value = 0;
  std::string color;
};

/// A bar of parts one after the other; the legend has those of at least the share `named` of all.
Plot bar_plot(const std::string& title, const std::string& unit, const std::vector<BarPart>& parts, double named);

}  // namespace hsi4d
