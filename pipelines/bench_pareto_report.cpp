#include <algorithm>
#include <cmath>

#include <nlohmann/json.hpp>

#include "core/formatted.h"
#include "core/text.h"
#include "pipelines/bench_machine.h"
#include "pipelines/bench_pareto.h"
#include "pipelines/report_plots.h"

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

Plot plot_of(const std::vector<ParetoPoint>& points, const std::string& title) {
  Plot plot{.title = title, .x_label = "time, ratio to the default's", .unit = "", .lines = {}};
  plot.is_log = plot.is_log_x = true;
  plot.ticks_x = {0.5, 0.7, 1, 1.5, 2, 3, 5, 7, 10, 20, 50};
  plot.decimals = 6;
  double least = 1, most = 1;
  for (const ParetoPoint& point : points) {
    least = std::min(least, point.time_ratio);
    most = std::max(most, point.time_ratio);
  }
  std::erase_if(plot.ticks_x, [least, most](double tick) { return tick < 0.97 * least || tick > 1.03 * most; });
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

std::string panel(const std::vector<ParetoRow>& rows, const std::string& scene, const PlottedError& error, double x,
                  double y) {
  const std::string title = std::string(error.name) + (scene.empty() ? ", median of all scenes" : ", " + scene);
  const std::vector<ParetoPoint> points = points_of(rows, scene, error);
  Plot plot = plot_of(points, title);
  plot.attributes =
      formatted(" x=\"%.0f\" y=\"%.0f\" width=\"%.0f\" height=\"%.0f\"", x, y + kHead, kPanelWidth, kPanelHeight);
  add_points(points, plot);
  const bool has_place =
      std::any_of(points.begin(), points.end(), [](const ParetoPoint& p) { return p.image_rms > 0; });
  return formatted("<text x=\"%.0f\" y=\"%.0f\" font-weight=\"bold\">", x + 8, y + 12) + html_escape(title) +
         (has_place ? "" : ": 0") + "</text>\n" + (has_place ? plot_svg(plot) : "") + "\n";
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

/// Panels in two columns, with a title and what colours mean.
std::string picture(const std::string& panels, std::size_t rows) {
  const double width = left_of(2), height = top_of(rows);
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

std::string pareto_csv(const std::vector<ParetoRow>& rows) {
  std::string text =
      "scene,knob,value,model,gaussians,pixels,fragments,pairs,repeats,threads,isa,median_ms,min_ms,forward_ms,forward_"
      "min_ms,backward_ms,"
      "backward_min_ms,forward_ratio,backward_ratio,time_ratio,psnr_db,image_rms,image_max,image_p999,image_bias";
  for (const char* name : kGradientClasses)
    for (const char* part : {"relative_l2", "one_minus_cosine", "bias"}) text += std::string(",") + name + "_" + part;
  text += "\n";
  for (const ParetoRow& row : rows) {
    text += csv_text(row.scene) + "," + row.knob + ",\"" + row.value + "\"," + model_name(row.model);
    for (const Index count : {row.gaussians, row.pixels, row.fragments, row.pairs, static_cast<Index>(row.repeats)})
      text += "," + std::to_string(count);
    text += "," + std::to_string(row.threads) + "," + isa_name(row.isa);
    for (const double value : {1e3 * row.both.median_s, 1e3 * row.both.least_s, 1e3 * row.forward.median_s,
                               1e3 * row.forward.least_s, 1e3 * row.backward.median_s, 1e3 * row.backward.least_s,
                               row.forward_ratio, row.backward_ratio, row.time_ratio})
      text += "," + csv_number(value);
    text += "," + (row.image.psnr_db() ? csv_number(*row.image.psnr_db()) : "");
    for (const double value : {row.image.rms, row.image.max, row.image.p999, row.image.bias})
      text += "," + csv_number(value);
    for (const GradientError& error : row.gradients)
      for (const double value : {error.relative_l2, error.one_minus_cosine, error.bias})
        text += "," + csv_number(value);
    text += "\n";
  }
  return text;
}

std::string pareto_json(const std::vector<ParetoRow>& rows) {
  std::string text;
  for (const ParetoRow& row : rows) text += bench_line(json_of(row).dump());
  return text;
}

std::string pareto_svg(const std::vector<ParetoRow>& rows) {
  const std::vector<std::string> columns = columns_of(rows);
  std::string body;
  for (std::size_t r = 0; r < kPlotted.size(); ++r)
    for (std::size_t c = 0; c < columns.size(); ++c)
      body += panel(rows, columns[c], kPlotted[r], left_of(c), top_of(r));
  return picture(body, kPlotted.size());
}

std::string pareto_front_svg(const std::vector<ParetoRow>& rows) {
  const std::string scene = columns_of(rows).empty() ? "" : columns_of(rows).back();
  return picture(panel(rows, scene, kPlotted[kImageError], left_of(0), top_of(0)) +
                     panel(rows, scene, kPlotted[kGradientError], left_of(1), top_of(0)),
                 1);
}

}  // namespace hsi4d
