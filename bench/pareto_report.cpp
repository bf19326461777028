#include <algorithm>
#include <cmath>
#include <sstream>

#include <nlohmann/json.hpp>

#include "bench/machine.h"
#include "bench/pareto.h"
#include "bench/pareto_tracking.h"
#include "core/table.h"
#include "pipelines/report/figure.h"

namespace hsi4d {

namespace {

const char* model_name(ParetoModel model) { return model == ParetoModel::kOwn ? "own" : "uncapped"; }

// --- tables ----------------------------------------------------------------------------------------------------------

/// Three digits; a dash for no error.
std::string error_text(double value) { return value == 0 ? "-" : formatted("%.2g", value); }

std::string psnr_text(const ImageError& error) {
  return error.psnr_db() ? formatted("%.1f", *error.psnr_db()) : std::string("-");
}

Table table_of(std::span<const ParetoRow> rows) {
  Table table{
      .head = {"", "time", "fwd ms", "least", "bwd ms", "least", "fragments", "pairs", "dB", "max", "p99.9", "bias"},
      .align = "lr"};
  table.head.insert(table.head.end(), kGradientClasses.begin(), kGradientClasses.end());
  for (const ParetoRow& row : rows) {
    table.rows.push_back({row.name(), Cell(row.time_ratio, 2), Cell(1e3 * row.forward.median_s, 2),
                          Cell(1e3 * row.forward.least_s, 2), Cell(1e3 * row.backward.median_s, 2),
                          Cell(1e3 * row.backward.least_s, 2), row.fragments, row.pairs, psnr_text(row.image),
                          error_text(row.image.max), error_text(row.image.p999), error_text(row.image.bias)});
    for (const GradientError& error : row.gradients) table.rows.back().emplace_back(error_text(error.relative_l2));
  }
  return table;
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
  Table table{.head = {"", "time", "image", "worst", "gradient", "worst", "on the front of"}, .align = "lrrrrrl"};
  for (const std::size_t i : order) {
    const ParetoPoint& point = points[i];
    if (!image[i] && !gradient[i] && !point.is_preset()) continue;
    table.rows.push_back({point.name(), Cell(point.time_ratio, 2), error_text(point.image_rms),
                          error_text(point.worst_image_rms), error_text(point.gradient),
                          error_text(point.worst_gradient),
                          image[i] && gradient[i] ? "image gradient"
                          : image[i]              ? "image"
                          : gradient[i]           ? "gradient"
                                                  : "-"});
  }
  return table_text(table);
}

constexpr const char* kChosenScene = "avatar_in_scene";

// --- numbers ---------------------------------------------------------------------------------------------------------

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

/// The columns of CSV, as places in the JSON object of a line: of a render, of a reconstruction.
std::vector<std::string> csv_places() {
  std::vector<std::string> places;
  const auto add = [&places](const char* keys) {
    std::istringstream words(keys);
    for (std::string key; words >> key;) places.push_back("/" + key);
  };
  add("scene knob value model gaussians pixels fragments pairs repeats threads isa median_ms min_ms forward_ms "
      "forward_min_ms backward_ms backward_min_ms forward_ratio backward_ratio time_ratio psnr_db image_rms image_max "
      "image_p999 image_bias");
  for (const std::string name : kGradientClasses)
    for (const char* const error : {"/relative_l2", "/one_minus_cosine", "/bias"})
      places.push_back("/gradients/" + name + error);
  add("tracking iterations seeds cost_ratio");
  for (const TrackedError& error : kTrackedErrors)
    for (const char* const part : {"/mean", "/deviation"}) places.push_back("/" + std::string(error.metric) + part);
  return places;
}

/// "/gradients/means/bias" is "means_bias".
std::string csv_name(const std::string& place) {
  constexpr std::string_view kGroup = "/gradients";
  std::string name = place.substr(place.starts_with(kGroup) ? kGroup.size() + 1 : 1);
  std::replace(name.begin(), name.end(), '/', '_');
  return name;
}

// --- picture ---------------------------------------------------------------------------------------------------------

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

/// A dot of its knob's colour, named where it is a preset.
/// @param point  ParetoPoint or TrackedPoint
template <class Point>
Series dot_of(const Point& point, double time, double error, bool is_named_below) {
  using Name = Series::Name;
  return {.label = point.is_preset() ? point.value : point.name(),
          .color = knob_color(point.knob),
          .points = {{time, error}},
          .line = 0,
          .dots = 3,
          .name = !point.is_preset() ? Name::kNone
                  : is_named_below   ? Name::kBelow
                                     : Name::kAbove};
}

/// The points, presets on top of the others.
template <class Point>
std::vector<Point> presets_last(std::vector<Point> points) {
  std::stable_partition(points.begin(), points.end(), [](const Point& point) { return !point.is_preset(); });
  return points;
}

/// Dots by knob, presets named, the front as a line. Points without error have no place on a logarithmic axis.
Plot panel(const std::vector<ParetoRow>& rows, const std::string& scene, const PlottedError& error) {
  const std::vector<ParetoPoint> points = points_of(rows, scene, error);
  Plot plot{.title = std::string(error.name) + (scene.empty() ? ", median of all scenes" : ", " + scene),
            .x_label = "time, ratio to the default's",
            .unit = "",
            .series = {{.label = "front", .color = "#999", .points = {}}},
            .is_log = true,
            .is_log_x = true,
            .decimals = 6,
            .width = kPanelWidth,
            .height = kPanelHeight};
  for (const std::size_t i : pareto_front(points, &ParetoPoint::image_rms))
    plot.series[0].points.emplace_back(points[i].time_ratio, points[i].image_rms);
  for (const ParetoPoint& point : presets_last(points))
    plot.series.push_back(dot_of(point, point.time_ratio, point.image_rms, point.value == "default"));
  return plot;
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

/// Dots at the means, on bars of a standard deviation to either side.
Plot tracked_panel(const std::vector<TrackedPoint>& tracked, bool is_fixed_time, const PlottedTracking& plotted) {
  Plot plot{.title = std::string(plotted.name) + ", " + plotted.unit +
                     (is_fixed_time ? ", after as long as the default" : ", after as many steps"),
            .x_label = "time of a step, ratio to the default's",
            .unit = plotted.unit,
            .series = {},
            .is_log_x = true,
            .begins_at_zero = true,
            .decimals = plotted.decimals,
            .width = kPanelWidth,
            .height = kPanelHeight};
  for (const TrackedPoint& point : presets_last(tracked)) {
    const auto [mean, deviation] = point.*plotted.place;
    plot.also.push_back(mean + deviation);  // of both budgets, which stand side by side
    if (point.is_fixed_time != is_fixed_time) continue;
    const Series dot = dot_of(point, point.cost_ratio, mean, is_named_below(point, tracked, plotted.place));
    plot.series.push_back(
        {.label = dot.label + formatted(": %.*f +- %.*f ", plotted.decimals, mean, plotted.decimals, deviation) +
                  plotted.unit,
         .color = dot.color,
         .points = {{point.cost_ratio, std::max(0.0, mean - deviation)}, {point.cost_ratio, mean + deviation}},
         .opacity = 0.45});
    plot.series.push_back(dot);
  }
  return plot;
}

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

/// What panels of renders stand under.
PictureSection renders_section() {
  PictureSection section{.title = "time against error, forward and backward; line: the front"};
  for (const std::string& knob : pareto_knobs()) section.legend.emplace_back(knob, knob_color(knob));
  return section;
}

}  // namespace

std::string pareto_table(const std::vector<ParetoRow>& rows) {
  std::string text;
  for (auto first = rows.begin(), end = first; first != rows.end(); first = end) {
    end = std::find_if(first, rows.end(), [&first](const ParetoRow& row) { return row.scene != first->scene; });
    text += (text.empty() ? "" : "\n") + first->scene + ": " + std::to_string(first->gaussians) + " Gaussians, " +
            std::to_string(first->pixels) + " pixels\n" + table_text(table_of({first, end}));
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
  Table table;
  const std::vector<std::string> places = csv_places();
  for (const std::string& place : places) table.head.emplace_back(csv_name(place));
  std::istringstream lines(pareto_json(rows) + tracking_json(tracked));
  for (std::string line; std::getline(lines, line);) {
    const nlohmann::json object = nlohmann::json::parse(line);
    table.rows.emplace_back();
    for (const std::string& place : places) {
      const nlohmann::json value = object.value(nlohmann::json::json_pointer(place), nlohmann::json(""));
      table.rows.back().emplace_back(value.is_string() ? value.get<std::string>() : value.dump());
    }
  }
  return table_csv(table);
}

std::string pareto_json(const std::vector<ParetoRow>& rows) {
  std::string text;
  for (const ParetoRow& row : rows) text += bench_line(json_of(row).dump());
  return text;
}

std::string pareto_svg(const std::vector<ParetoRow>& rows, const std::vector<TrackedPoint>& tracked) {
  const std::vector<std::string> columns = columns_of(rows);
  std::vector<PictureSection> sections = {renders_section()};
  sections[0].columns = columns.size();
  for (const PlottedError& error : kPlotted)
    for (const std::string& scene : columns) sections[0].plots.push_back(panel(rows, scene, error));
  if (!tracked.empty()) {
    sections.push_back({.title = "what it comes to: errors of a reconstruction, mean and standard deviation of " +
                                 std::to_string(tracked.front().seeds) + " seeds"});
    for (const PlottedTracking& plotted : kPlottedTracking)
      for (const bool is_fixed_time : {false, true})
        sections[1].plots.push_back(tracked_panel(tracked, is_fixed_time, plotted));
  }
  return picture_svg(sections);
}

std::string pareto_front_svg(const std::vector<ParetoRow>& rows) {
  const std::string scene = columns_of(rows).empty() ? "" : columns_of(rows).back();
  PictureSection section = renders_section();
  section.plots = {panel(rows, scene, kPlotted[kImageError]), panel(rows, scene, kPlotted[kGradientError])};
  return picture_svg({section});
}

}  // namespace hsi4d
