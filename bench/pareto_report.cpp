#include <algorithm>
#include <cmath>

#include <nlohmann/json.hpp>

#include "bench/machine.h"
#include "bench/pareto.h"
#include "core/formatted.h"
#include "core/text.h"
#include "pipelines/report/plots.h"

namespace hsi4d {

namespace {

const char* model_name(ParetoModel model) { return model == ParetoModel::kOwn ? "own" : "uncapped"; }

// --- tables ----------------------------------------------------------------------------------------------------------

/// Three digits; a dash for no error.
std::string error_text(double value) { return value == 0 ? "-" : formatted("%.2g", value); }

std::string psnr_text(const ImageError& error) {
  return error.psnr_db() ? formatted("%.1f", *error.psnr_db()) : std::string("-");
}

std::string row_line(const ParetoRow& row) {
  std::string line = formatted(
      "%-40s %6.2f %8.2f %8.2f %8.2f %8.2f %10lld %8lld  %6s %8s %8s %9s ", row.name().c_str(), row.time_ratio,
      1e3 * row.forward.median_s, 1e3 * row.forward.least_s, 1e3 * row.backward.median_s, 1e3 * row.backward.least_s,
      static_cast<long long>(row.fragments), static_cast<long long>(row.pairs), psnr_text(row.image).c_str(),
      error_text(row.image.max).c_str(), error_text(row.image.p999).c_str(), error_text(row.image.bias).c_str());
  for (const GradientError& error : row.gradients) line += formatted(" %8s", error_text(error.relative_l2).c_str());
  return line + "\n";
}

std::string head_line() {
  std::string line = formatted("%-40s %6s %8s %8s %8s %8s %10s %8s  %6s %8s %8s %9s ", "", "time", "fwd ms", "least",
                               "bwd ms", "least", "fragments", "pairs", "dB", "max", "p99.9", "bias");
  for (const char* name : kGradientClasses) line += formatted(" %8s", std::string(name).substr(0, 8).c_str());
  return line + "\n";
}

std::string point_line(const ParetoPoint& point, bool is_on_image_front, bool is_on_gradient_front) {
  return formatted("  %-40s %6.2f %9s %9s %9s %9s  %s\n", point.name().c_str(), point.time_ratio,
                   error_text(point.image_rms).c_str(), error_text(point.worst_image_rms).c_str(),
                   error_text(point.gradient).c_str(), error_text(point.worst_gradient).c_str(),
                   is_on_image_front && is_on_gradient_front ? "image gradient"
                   : is_on_image_front                       ? "image"
                   : is_on_gradient_front                    ? "gradient"
                                                             : "-");
}

/// Whether each point is on the front.
std::vector<bool> on_front(const std::vector<ParetoPoint>& points, double ParetoPoint::*error) {
  std::vector<bool> result(points.size());
  for (const std::size_t i : pareto_front(points, error)) result[i] = true;
  return result;
}

std::string front_lines(const std::vector<ParetoPoint>& points) {
  const std::vector<bool> image = on_front(points, &ParetoPoint::image_rms),
                          gradient = on_front(points, &ParetoPoint::gradient);
  std::vector<std::size_t> order(points.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::stable_sort(order.begin(), order.end(),
                   [&points](std::size_t a, std::size_t b) { return points[a].time_ratio < points[b].time_ratio; });
  std::string text = formatted("  %-40s %6s %9s %9s %9s %9s  %s\n", "", "time", "image", "worst", "gradient", "worst",
                               "on the front of");
  for (const std::size_t i : order)
    if (image[i] || gradient[i] || points[i].is_preset()) text += point_line(points[i], image[i], gradient[i]);
  return text;
}

constexpr const char* kChosenScene = "avatar_in_scene";

// --- numbers ---------------------------------------------------------------------------------------------------------

/// A number in CSV; nothing where it is none.
std::string csv_number(double value) { return std::isfinite(value) ? formatted("%.9g", value) : ""; }

/// A text in CSV.
std::string csv_text(const std::string& text) {
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

/// The columns of a render; then those of a reconstruction.
std::vector<std::string> csv_columns() {
  std::vector<std::string> names = {
      "scene",          "knob",        "value",           "model",         "gaussians",      "pixels",     "fragments",
      "pairs",          "repeats",     "threads",         "isa",           "median_ms",      "min_ms",     "forward_ms",
      "forward_min_ms", "backward_ms", "backward_min_ms", "forward_ratio", "backward_ratio", "time_ratio", "psnr_db",
      "image_rms",      "image_max",   "image_p999",      "image_bias"};
  for (const char* name : kGradientClasses)
    for (const char* part : {"relative_l2", "one_minus_cosine", "bias"})
      names.push_back(std::string(name) + "_" + part);
  return names;
}

std::vector<std::string> tracked_csv_columns() {
  std::vector<std::string> names = {"tracking", "iterations", "seeds", "cost_ratio"};
  for (const TrackedError& error : kTrackedErrors) {
    names.push_back(std::string(error.metric) + "_mean");
    names.push_back(std::string(error.metric) + "_deviation");
  }
  return names;
}

std::string csv_line(const ParetoRow& row) {
  std::string line = csv_text(row.scene) + "," + row.knob + ",\"" + row.value + "\"," + model_name(row.model);
  for (const Index count : {row.gaussians, row.pixels, row.fragments, row.pairs, static_cast<Index>(row.repeats)})
    line += "," + std::to_string(count);
  line += "," + std::to_string(row.threads) + "," + isa_name(row.isa);
  for (const double value :
       {1e3 * row.both.median_s, 1e3 * row.both.least_s, 1e3 * row.forward.median_s, 1e3 * row.forward.least_s,
        1e3 * row.backward.median_s, 1e3 * row.backward.least_s, row.forward_ratio, row.backward_ratio, row.time_ratio})
    line += "," + csv_number(value);
  line += "," + (row.image.psnr_db() ? csv_number(*row.image.psnr_db()) : "");
  for (const double value : {row.image.rms, row.image.max, row.image.p999, row.image.bias})
    line += "," + csv_number(value);
  for (const GradientError& error : row.gradients)
    for (const double value : {error.relative_l2, error.one_minus_cosine, error.bias}) line += "," + csv_number(value);
  return line + std::string(tracked_csv_columns().size(), ',') + "\n";
}

std::string csv_line(const TrackedPoint& point) {
  const std::size_t of_a_render = csv_columns().size();
  std::string line = "," + point.knob + ",\"" + point.value + "\"" + std::string(of_a_render - 3, ',') + "," +
                     point.budget() + "," + std::to_string(point.iterations) + "," + std::to_string(point.seeds) + "," +
                     csv_number(point.cost_ratio);
  for (const TrackedError& error : kTrackedErrors) {
    const TrackedPoint::Spread& spread = point.*error.place;
    line += "," + csv_number(spread.mean) + "," + csv_number(spread.deviation);
  }
  return line + "\n";
}

nlohmann::ordered_json json_of(const ParetoRow& row) {
  nlohmann::ordered_json line = {{"name", "pareto/" + row.scene + "/" + row.name()},
                                 {"scene", row.scene},
                                 {"knob", row.knob},
                                 {"value", row.value},
                                 {"extreme", row.is_extreme},
                                 {"model", model_name(row.model)},
                                 {"isa", isa_name(row.isa)},
                                 {"threads", row.threads},
                                 {"median_ms", 1e3 * row.both.median_s},
                                 {"min_ms", 1e3 * row.both.least_s},
                                 {"repeats", row.repeats},
                                 {"gaussians", row.gaussians},
                                 {"pixels", row.pixels},
                                 {"fragments", row.fragments},
                                 {"pairs", row.pairs},
                                 {"mfragments_per_s", row.mfragments_per_s()},
                                 {"forward_ms", 1e3 * row.forward.median_s},
                                 {"forward_min_ms", 1e3 * row.forward.least_s},
                                 {"backward_ms", 1e3 * row.backward.median_s},
                                 {"backward_min_ms", 1e3 * row.backward.least_s},
                                 {"forward_ratio", row.forward_ratio},
                                 {"backward_ratio", row.backward_ratio},
                                 {"time_ratio", row.time_ratio}};
  if (row.image.psnr_db()) line["psnr_db"] = *row.image.psnr_db();
  line.update({{"image_rms", row.image.rms},
               {"image_max", row.image.max},
               {"image_p999", row.image.p999},
               {"image_bias", row.image.bias}});
  for (std::size_t c = 0; c < kGradientClasses.size(); ++c) {
    const GradientError& error = row.gradients[c];
    nlohmann::ordered_json& to = line["gradients"][kGradientClasses[c]];
    for (const auto& [name, value] :
         {std::pair{"relative_l2", error.relative_l2}, std::pair{"one_minus_cosine", error.one_minus_cosine},
          std::pair{"bias", error.bias}})
      if (std::isfinite(value)) to[name] = value;
  }
  return line;
}

// --- picture ---------------------------------------------------------------------------------------------------------

constexpr double kPanelWidth = 460, kPanelHeight = 254;  // as plots are: 210 high for 380, enlarged
constexpr double kTitle = 66, kHead = 24, kGap = 26;     // of the picture; above and beside each panel
constexpr double kSection = 40;                          // above the panels of reconstructions

/// An error over rows of one setting, a row of panels each.
struct PlottedError {
  const char* name;
  double (*of)(const ParetoRow&);
};

double largest(const GradientErrors& errors, double GradientError::*part) {
  double worst = 0;
  for (const GradientError& error : errors) worst = std::max(worst, std::abs(error.*part));
  return worst;
}

constexpr std::array<PlottedError, 8> kPlotted = {
    {{"image, RMS", [](const ParetoRow& r) { return r.image.rms; }},
     {"image, largest", [](const ParetoRow& r) { return r.image.max; }},
     {"image, 99.9th percentile", [](const ParetoRow& r) { return r.image.p999; }},
     {"image, |bias|", [](const ParetoRow& r) { return std::abs(r.image.bias); }},
     {"gradient, relative L2, worst class", [](const ParetoRow& r) { return r.worst_gradient(); }},
     {"gradient of the camera, relative L2", [](const ParetoRow& r) { return r.gradients.back().relative_l2; }},
     {"gradient, 1 - cosine, worst class",
      [](const ParetoRow& r) { return largest(r.gradients, &GradientError::one_minus_cosine); }},
     {"gradient, |bias|, worst class", [](const ParetoRow& r) { return largest(r.gradients, &GradientError::bias); }}}};

constexpr std::size_t kImageError = 0, kGradientError = 4;  // of these, what settings are chosen by

/// The points with this error as their image's: pareto_points takes medians of it.
std::vector<ParetoPoint> points_of(std::vector<ParetoRow> rows, const std::string& scene, const PlottedError& error) {
  for (ParetoRow& row : rows) row.image.rms = error.of(row);
  return pareto_points(rows, scene);
}

/// Ticks of a logarithmic axis of ratios that has 1: those between the least and the most of them.
std::vector<double> ratio_ticks(const std::vector<double>& ratios) {
  const double least = std::min(1.0, *std::min_element(ratios.begin(), ratios.end())),
               most = std::max(1.0, *std::max_element(ratios.begin(), ratios.end()));
  std::vector<double> ticks = {0.5, 0.7, 1, 1.5, 2, 3, 5, 7, 10, 20, 50};
  if (most < 5 * least) ticks = {0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1, 1.1, 1.2, 1.3, 1.4, 1.6, 1.8, 2, 2.5, 3, 3.5, 4, 5};
  std::erase_if(ticks, [least, most](double tick) { return tick < 0.97 * least || tick > 1.03 * most; });
  return ticks;
}

Plot plot_of(const std::vector<ParetoPoint>& points, const std::string& title) {
  Plot plot{.title = title, .x_label = "time, ratio to the default's", .unit = "", .lines = {}};
  plot.is_log = plot.is_log_x = true;
  plot.decimals = 6;
  std::vector<double> ratios = {1};
  for (const ParetoPoint& point : points) ratios.push_back(point.time_ratio);
  plot.ticks_x = ratio_ticks(ratios);
  return plot;
}

/// Presets are dark and products pale; the other knobs have the colours that there are.
std::string knob_color(const std::string& knob) {
  if (knob == "quality") return "#111";
  if (knob == "product") return "#b3b8bd";
  std::size_t place = 0;
  for (const std::string& other : pareto_knobs()) {
    if (other == knob) break;
    place += other != "quality" && other != "product" ? 1 : 0;
  }
  return part_color(place);
}

/// Dots by knob, presets named, the front as a line. Points without error have no place on a logarithmic axis.
void add_points(const std::vector<ParetoPoint>& points, Plot& plot) {
  PlotLine front{.label = "front", .color = "#999", .points = {}};
  for (const std::size_t i : pareto_front(points, &ParetoPoint::image_rms))
    front.points.emplace_back(points[i].time_ratio, points[i].image_rms);
  plot.lines.push_back(std::move(front));
  const auto add = [&plot](const ParetoPoint& point) {
    plot.lines.push_back({.label = point.is_preset() ? point.value : point.name(),
                          .color = knob_color(point.knob),
                          .points = {{point.time_ratio, point.image_rms}},
                          .has_dots = true,
                          .opacity = 0,
                          .is_named = point.is_preset(),
                          .name_is_below = point.value == "default"});
  };
  for (const ParetoPoint& point : points)
    if (!point.is_preset()) add(point);
  for (const ParetoPoint& point : points)  // on top of the others
    if (point.is_preset()) add(point);
}

/// Where a plot stands whose panel begins at (x, y).
std::string place_in_picture(double x, double y) {
  return formatted(" x=\"%.0f\" y=\"%.0f\" width=\"%.0f\" height=\"%.0f\"", x, y + kHead, kPanelWidth, kPanelHeight);
}

std::string panel_title(double x, double y, const std::string& title) {
  return formatted("<text x=\"%.0f\" y=\"%.0f\" font-weight=\"bold\">", x + 8, y + 12) + html_escape(title) +
         "</text>\n";
}

std::string panel(const std::vector<ParetoRow>& rows, const std::string& scene, const PlottedError& error, double x,
                  double y) {
  const std::string title = std::string(error.name) + (scene.empty() ? ", median of all scenes" : ", " + scene);
  const std::vector<ParetoPoint> points = points_of(rows, scene, error);
  Plot plot = plot_of(points, title);
  plot.attributes = place_in_picture(x, y);
  add_points(points, plot);
  const bool has_place =
      std::any_of(points.begin(), points.end(), [](const ParetoPoint& p) { return p.image_rms > 0; });
  return panel_title(x, y, title + (has_place ? "" : ": 0")) + (has_place ? plot_svg(plot) : "") + "\n";
}

// Panels of reconstructions.

/// An error of reconstructions that has a row of panels.
struct PlottedTracking {
  const char* name;
  const char* unit;
  TrackedPoint::Spread TrackedPoint::*place;
  int decimals;
};
constexpr std::array<PlottedTracking, 4> kPlottedTracking = {
    {{"joints beside the pelvis", "mm", &TrackedPoint::joints_mm, 2},
     {"joints in the world", "mm", &TrackedPoint::world_mm, 2},
     {"object", "cm", &TrackedPoint::object_cm, 2},
     {"camera", "degrees", &TrackedPoint::camera_deg, 4}}};

/// Whether a preset's name stands below its dot: away from another preset nearby.
bool is_named_below(const TrackedPoint& point, const std::vector<TrackedPoint>& tracked,
                    TrackedPoint::Spread TrackedPoint::*place) {
  return std::any_of(tracked.begin(), tracked.end(), [&](const TrackedPoint& other) {
    return other.is_preset() && other.is_fixed_time == point.is_fixed_time &&
           std::abs(std::log(other.cost_ratio / point.cost_ratio)) < 0.2 && (other.*place).mean > (point.*place).mean;
  });
}

/// A dot at the mean, on a bar of a standard deviation to either side.
void add_tracked(const TrackedPoint& point, const PlottedTracking& plotted, bool is_below, Plot& plot) {
  const TrackedPoint::Spread& spread = point.*plotted.place;
  const std::string name = point.is_preset() ? point.value : point.name();
  plot.lines.push_back(
      {.label = name + formatted(": %.*f +- %.*f ", plotted.decimals, spread.mean, plotted.decimals, spread.deviation) +
                plotted.unit,
       .color = knob_color(point.knob),
       .points = {{point.cost_ratio, std::max(0.0, spread.mean - spread.deviation)},
                  {point.cost_ratio, spread.mean + spread.deviation}},
       .opacity = 0.45});
  plot.lines.push_back({.label = name,
                        .color = knob_color(point.knob),
                        .points = {{point.cost_ratio, spread.mean}},
                        .has_dots = true,
                        .opacity = 0,
                        .is_named = point.is_preset(),
                        .name_is_below = is_below});
}

std::string tracked_panel(const std::vector<TrackedPoint>& tracked, bool is_fixed_time, const PlottedTracking& plotted,
                          double x, double y) {
  const std::string title = std::string(plotted.name) + ", " + plotted.unit +
                            (is_fixed_time ? ", after as long as the default" : ", after as many steps");
  Plot plot{.title = title,
            .x_label = "time of a step, ratio to the default's",
            .unit = plotted.unit,
            .lines = {},
            .is_log_x = true,
            .begins_at_zero = true,
            .decimals = plotted.decimals,
            .attributes = place_in_picture(x, y)};
  std::vector<double> ratios = {1};
  for (const TrackedPoint& point : tracked) {
    ratios.push_back(point.cost_ratio);
    const TrackedPoint::Spread& spread = point.*plotted.place;
    plot.also_y.push_back(spread.mean + spread.deviation);  // of both budgets, which stand side by side
  }
  plot.ticks_x = ratio_ticks(ratios);
  for (const bool is_preset : {false, true})  // presets on top of the others
    for (const TrackedPoint& point : tracked)
      if (point.is_fixed_time == is_fixed_time && point.is_preset() == is_preset)
        add_tracked(point, plotted, is_named_below(point, tracked, plotted.place), plot);
  return panel_title(x, y, title) + plot_svg(plot) + "\n";
}

std::string legend(double y) {
  std::string text;
  double x = kGap + 8;
  for (const std::string& knob : pareto_knobs()) {
    text += formatted("<circle cx=\"%.0f\" cy=\"%.0f\" r=\"4\" fill=\"%s\"/>", x + 5, y - 4, knob_color(knob).c_str()) +
            formatted("<text x=\"%.0f\" y=\"%.0f\">", x + 13, y) + html_escape(knob) + "</text>\n";
    x += 24 + 6.2 * static_cast<double>(knob.size());
  }
  return text;
}

constexpr const char* kStyle =
    "<style>.plot text{font-size:11px;fill:#555}.plot .name{font-size:9px;fill:#222}.plot .grid{stroke:#e4e4e4}"
    ".plot .axis{stroke:#888}.plot polyline{fill:none;stroke-width:1.6}</style>\n";

/// The scenes that have a column: all, where there are several, and the one that defaults are chosen by, or the only
/// one.
std::vector<std::string> columns_of(const std::vector<ParetoRow>& rows) {
  std::vector<std::string> scenes;
  for (const ParetoRow& row : rows)
    if (!row.is_extreme && std::find(scenes.begin(), scenes.end(), row.scene) == scenes.end())
      scenes.push_back(row.scene);
  if (scenes.size() < 2) return scenes;
  const bool has_chosen = std::find(scenes.begin(), scenes.end(), kChosenScene) != scenes.end();
  return has_chosen ? std::vector<std::string>{"", kChosenScene} : std::vector<std::string>{""};
}

double left_of(std::size_t column) { return kGap + (kPanelWidth + kGap) * static_cast<double>(column); }
double top_of(std::size_t row) { return kTitle + (kHead + kPanelHeight + kGap) * static_cast<double>(row); }

/// The panels of reconstructions, from `top` on.
std::string tracked_panels(const std::vector<TrackedPoint>& tracked, double top) {
  std::string text =
      formatted("<text x=\"%.0f\" y=\"%.0f\" font-size=\"16\">", kGap + 8, top + 14) +
      formatted("what it comes to: errors of a reconstruction, mean and standard deviation of %lld seeds",
                static_cast<long long>(tracked.front().seeds)) +
      "</text>\n";
  for (std::size_t r = 0; r < kPlottedTracking.size(); ++r)
    for (const bool is_fixed_time : {false, true})
      text += tracked_panel(tracked, is_fixed_time, kPlottedTracking[r], left_of(is_fixed_time ? 1 : 0),
                            top + kSection + top_of(r) - top_of(0));
  return text;
}

/// Panels in two columns, with a title and what colours mean.
std::string picture(const std::string& panels, double height) {
  const double width = left_of(2);
  return formatted("<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %.0f %.0f\" ", width, height) +
         formatted("width=\"%.0f\" height=\"%.0f\" font-family=\"sans-serif\" font-size=\"12\" fill=\"#222\">\n", width,
                   height) +
         kStyle + formatted("<rect width=\"%.0f\" height=\"%.0f\" fill=\"#fff\"/>\n", width, height) +
         formatted("<text x=\"%.0f\" y=\"26\" font-size=\"16\">", kGap + 8) +
         "time against error, forward and backward; line: the front</text>\n" + legend(48) + panels + "</svg>\n";
}

}  // namespace

std::string pareto_table(const std::vector<ParetoRow>& rows) {
  std::string text, scene;
  for (const ParetoRow& row : rows) {
    if (row.scene != scene) {
      text += (text.empty() ? "" : "\n") + row.scene +
              formatted(": %lld Gaussians, %lld pixels\n", static_cast<long long>(row.gaussians),
                        static_cast<long long>(row.pixels)) +
              head_line();
    }
    scene = row.scene;
    text += row_line(row);
  }
  return text;
}

std::string pareto_front_table(const std::vector<ParetoRow>& rows) {
  std::string text;
  for (const std::string& scene : columns_of(rows)) {
    text += (text.empty() ? "" : "\n") + std::string("front, ") +
            (scene.empty() ? "all scenes: geometric mean of time, median and worst error" : scene) + "\n" +
            front_lines(pareto_points(rows, scene));
  }
  return text;
}

std::string pareto_csv(const std::vector<ParetoRow>& rows, const std::vector<TrackedPoint>& tracked) {
  std::string text;
  for (const std::string& name : csv_columns()) text += (text.empty() ? "" : ",") + name;
  for (const std::string& name : tracked_csv_columns()) text += "," + name;
  text += "\n";
  for (const ParetoRow& row : rows) text += csv_line(row);
  for (const TrackedPoint& point : tracked) text += csv_line(point);
  return text;
}

std::string pareto_json(const std::vector<ParetoRow>& rows) {
  std::string text;
  for (const ParetoRow& row : rows) text += bench_line(json_of(row).dump());
  return text;
}

std::string pareto_svg(const std::vector<ParetoRow>& rows, const std::vector<TrackedPoint>& tracked) {
  const std::vector<std::string> columns = columns_of(rows);
  std::string body;
  for (std::size_t r = 0; r < kPlotted.size(); ++r)
    for (std::size_t c = 0; c < columns.size(); ++c)
      body += panel(rows, columns[c], kPlotted[r], left_of(c), top_of(r));
  double height = top_of(kPlotted.size());
  if (!tracked.empty()) {
    body += tracked_panels(tracked, height);
    height += kSection + top_of(kPlottedTracking.size()) - top_of(0);
  }
  return picture(body, height);
}

std::string pareto_front_svg(const std::vector<ParetoRow>& rows) {
  const std::string scene = columns_of(rows).empty() ? "" : columns_of(rows).back();
  return picture(panel(rows, scene, kPlotted[kImageError], left_of(0), top_of(0)) +
                     panel(rows, scene, kPlotted[kGradientError], left_of(1), top_of(0)),
                 top_of(1));
}

}  // namespace hsi4d
