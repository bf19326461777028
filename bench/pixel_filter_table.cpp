#include "bench/pixel_filter_table.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "bench/list.h"
#include "body/procedural_body.h"
#include "core/check.h"
#include "core/file.h"
#include "core/formatted.h"
#include "core/parallel.h"
#include "core/table.h"
#include "core/text.h"
#include "pipelines/draw/posed_avatar.h"

namespace hsi4d {

namespace {

/// One filter, judged on one figure at one distance.
struct FilterMeasurement {
  std::string name;  ///< "pixel_filter/FIGURE/HEIGHT/TRUTH/FILTER"
  Index gaussians = 0;
  double height_px = 0;   ///< of the figure
  double distance_m = 0;  ///< from the camera
  double sigma_px = 0;    ///< mean standard deviation of a Gaussian along the surface, without blur
  double blur = 0;        ///< pixels²
  bool antialias = false;
  SilhouetteError error;
  double distance_error =
      0;  ///< relative: how much farther away the figure looks most like the truth, in least squares
};

constexpr double kFocalPx = 600;
constexpr int kMarginPx = 8;
constexpr int kSupersample = 8;
/// The limits on x/z would differ between bands of an image and the whole of it; no limit is near.
constexpr double kNoClamp = 100;
constexpr double kBoxVariance = 1.0 / 12;  // of a square pixel, along each side
constexpr double kWidestBlur = 0.6, kNarrowestBlur = 1e-5;

struct NamedFigure {
  const char* name;
  Index gaussians;
};
constexpr std::array<NamedFigure, 2> kFigures = {{{"avatar_5000", 5000}, {"avatar_40000", 40000}}};

/// Where the figure lies against the grid of pixels. Small figures have few edges and are looked at in all four places.
const std::array<Vector2<double>, 4> kShifts = {{{0.13, 0.29}, {0.63, 0.79}, {0.38, 0.04}, {0.88, 0.54}}};
constexpr double kSmallPx = 128;

struct Extent {
  double width = 0, top = 0, bottom = 0;  ///< metres; top and bottom along y
};

Extent extent_of(const PosedGaussians& figure) {
  Extent e{0, -1e9, 1e9};
  const std::vector<float>& means = figure.gaussians.means;
  for (std::size_t i = 0; i < means.size(); i += 3) {
    e.width = std::max(e.width, 2 * std::abs(static_cast<double>(means[i])));
    e.top = std::max(e.top, static_cast<double>(means[i + 1]));
    e.bottom = std::min(e.bottom, static_cast<double>(means[i + 1]));
  }
  return e;
}

/// Metres: the first of a disc's scales lies in the surface.
double mean_sigma(const PosedGaussians& figure) {
  double sum = 0;
  for (std::size_t i = 0; i < figure.gaussians.log_scales.size(); i += 3)
    sum += std::exp(static_cast<double>(figure.gaussians.log_scales[i]));
  return sum / static_cast<double>(figure.gaussians.count());
}

struct Filter {
  double blur = 0;
  bool antialias = false;
};

/// One place of the figure on the grid of pixels.
struct Shot {
  SceneView view;
  SceneImage truth;
};

SceneView filtered(SceneView view, const Filter& filter) {
  view.settings.blur = filter.blur;
  view.settings.antialias = filter.antialias;
  return view;
}

SilhouetteError mean_of(const std::vector<SilhouetteError>& errors) {
  SilhouetteError mean;
  double squares = 0;
  const auto n = static_cast<double>(errors.size());
  for (const SilhouetteError& e : errors) {
    mean.width_px += e.width_px / n;
    mean.half_width_px += e.half_width_px / n;
    mean.brightness += e.brightness / n;
    squares += e.rms * e.rms / n;
  }
  mean.rms = std::sqrt(squares);
  return mean;
}

template <class Render>
SilhouetteError error_of(const std::vector<Shot>& shots, Render&& render) {
  std::vector<SilhouetteError> errors;
  for (const Shot& shot : shots) errors.push_back(silhouette_error(render(shot.view), shot.truth));
  return mean_of(errors);
}

/// Where f is least in [low, high], by golden sections.
template <class F>
double least(double low, double high, int steps, F&& f) {
  const double section = (std::sqrt(5.0) - 1) / 2;
  double a = high - section * (high - low), b = low + section * (high - low), at_a = f(a), at_b = f(b);
  for (int i = 0; i < steps; ++i) {
    if (at_a < at_b) {
      high = b, b = a, at_b = at_a;
      at_a = f(a = high - section * (high - low));
    } else {
      low = a, a = b, at_a = at_b;
      at_b = f(b = low + section * (high - low));
    }
  }
  return (low + high) / 2;
}

/// A figure at one distance with its truth.
struct Case {
  const PosedGaussians& figure;
  std::vector<Shot> shots;

  SilhouetteError error(const Filter& filter) const {
    return error_of(shots, [&](const SceneView& view) { return render_scene(figure, filtered(view, filter)); });
  }

  /// The blur with the least error of the image.
  Filter matched(bool antialias) const {
    const double sigma = least(0, std::sqrt(kWidestBlur), 12, [&](double s) {
      return error(Filter{s * s, antialias}).rms;
    });
    return {sigma * sigma, antialias};
  }

  /// The widest blur that keeps widths within the goal; the error grows with the blur.
  Filter within(bool antialias) const {
    double low = std::log(kNarrowestBlur), high = std::log(kWidestBlur);
    for (int i = 0; i < 12; ++i) {
      const double middle = (low + high) / 2;
      (error(Filter{std::exp(middle), antialias}).width_px <= kWidthGoalPx ? low : high) = middle;
    }
    return {std::exp(low), antialias};
  }

  /// Sum of squared differences of colours when the figure is moved away by this share of its distance.
  double misfit(const Filter& filter, double share) const {
    double sum = 0;
    for (const Shot& shot : shots) {
      SceneView view = filtered(shot.view, filter);
      view.camera.camera_from_world.translation[2] *= 1 + share;
      const double rms = silhouette_error(render_scene(figure, view), shot.truth).rms;
      sum += rms * rms;
    }
    return sum;
  }

  double distance_error(const Filter& filter, double height_px) const {
    const double low = -2 / height_px, step = 1 / height_px;  // one step is a pixel of height
    int best = 0;
    double least_misfit = misfit(filter, low);
    for (int i = 1; i <= 8; ++i) {
      const double at = misfit(filter, low + i * step);
      if (at < least_misfit) best = i, least_misfit = at;
    }
    return least(low + (best - 1) * step, low + (best + 1) * step, 10, [&](double s) { return misfit(filter, s); });
  }
};

/// What a render is compared with.
struct TrueSilhouette {
  const char* name;
  int factor;   ///< samples a pixel and direction
  double blur;  ///< pixels² of the large image
  double soft;  ///< variance of the lens, pixels²; 0: none
};
constexpr std::array<TrueSilhouette, 3> kTruths = {
    {{"box", kSupersample, 0, 0}, {"soft", kSupersample, 0, 0.25}, {"clip", 2, kBlur, 0}}};

Case case_of(const PosedGaussians& figure, double height_px, const TrueSilhouette& truth) {
  Case c{figure, {}};
  const std::size_t shots = height_px <= kSmallPx ? kShifts.size() : 1;
  for (std::size_t i = 0; i < shots; ++i) {
    const SceneView view = figure_view(figure, height_px, kShifts[i]);
    const SceneImage seen = supersampled(figure, filtered(view, {truth.blur, false}), truth.factor);
    c.shots.push_back({view, truth.soft > 0 ? softened(seen, truth.soft) : seen});
  }
  return c;
}

using Report = std::function<void(const FilterMeasurement&)>;

/// Everything of one figure at one distance.
class FigureBench {
 public:
  FigureBench(const char* name, const PosedGaussians& figure, double height_px, const Report& report)
      : name_(name), figure_(figure), height_px_(height_px), report_(report) {}

  void against(const TrueSilhouette& truth) const {
    const Case c = case_of(figure_, height_px_, truth);
    judge(c, truth, "none", {0, false});
    judge(c, truth, "plain", {kBlur, false});
    judge(c, truth, "antialias", {kBlur, true});
    judge(c, truth, "plain_box", {kBoxVariance, false});
    judge(c, truth, "antialias_box", {kBoxVariance, true});
    judge(c, truth, "antialias_sharp", {kSharpBlur, true});
    judge(c, truth, "plain_matched", c.matched(false));
    judge(c, truth, "antialias_matched", c.matched(true));
    if (truth.blur > 0 || truth.soft > 0) return;
    judge(c, truth, "antialias_within", c.within(true));
    FilterMeasurement m = measurement(truth, "truth_4x", {0, false});
    m.error = error_of(c.shots, [&](const SceneView& view) {
      return supersampled(figure_, filtered(view, {0, false}), kSupersample / 2);
    });
    report_(m);
  }

 private:
  FilterMeasurement measurement(const TrueSilhouette& truth, const std::string& filter_name,
                                const Filter& filter) const {
    FilterMeasurement m;
    m.name = "pixel_filter/" + name_ + "/" + rounded(height_px_, 4) + "/" + truth.name + "/" + filter_name;
    m.gaussians = figure_.gaussians.count();
    m.height_px = height_px_;
    m.distance_m = figure_view(figure_, height_px_, {0, 0}).camera.camera_from_world.translation[2];
    m.sigma_px = mean_sigma(figure_) * kFocalPx / m.distance_m;
    m.blur = filter.blur;
    m.antialias = filter.antialias;
    return m;
  }
  void judge(const Case& c, const TrueSilhouette& truth, const std::string& filter_name, const Filter& filter) const {
    FilterMeasurement m = measurement(truth, filter_name, filter);
    m.error = c.error(filter);
    m.distance_error = c.distance_error(filter, height_px_);
    report_(m);
  }

  std::string name_;
  const PosedGaussians& figure_;
  double height_px_;
  const Report& report_;
};

std::string filter_row(const FilterMeasurement& m) {
  const nlohmann::ordered_json line = {{"name", m.name},
                                       {"gaussians", m.gaussians},
                                       {"height_px", m.height_px},
                                       {"distance_m", m.distance_m},
                                       {"sigma_px", m.sigma_px},
                                       {"blur", m.blur},
                                       {"antialias", m.antialias},
                                       {"width_px", m.error.width_px},
                                       {"half_width_px", m.error.half_width_px},
                                       {"brightness", m.error.brightness},
                                       {"rms", m.error.rms},
                                       {"distance_error", m.distance_error}};
  return line.dump() + "\n";
}

}  // namespace

PosedGaussians filter_figure(Index gaussians) {
  AvatarSettings settings;
  settings.gaussians = gaussians;
  const Avatar avatar = surface_avatar(procedural_body(), settings);
  PosedGaussians figure = posed_avatar(avatar, rest_pose(avatar.joint_count()));
  figure.transforms.clear();  // they are the identity
  return figure;
}

SceneView figure_view(const PosedGaussians& figure, double height_px, const Vector2<double>& shift_px) {
  const Extent e = extent_of(figure);
  const double height = e.top - e.bottom;
  SceneView view;
  view.precision = Precision::kDouble;
  view.settings.frustum_clamp = kNoClamp;
  Camera& camera = view.camera;
  camera.width = static_cast<int>(std::ceil(e.width / height * height_px)) + 2 * kMarginPx;
  camera.height = static_cast<int>(std::ceil(height_px)) + 2 * kMarginPx;
  camera.fx = camera.fy = kFocalPx;
  camera.cx = camera.width / 2.0 + shift_px[0];
  camera.cy = camera.height / 2.0 + shift_px[1];
  camera.camera_from_world.rotation = Vector3<double>(1, -1, -1).asDiagonal();
  camera.camera_from_world.translation = {0, (e.top + e.bottom) / 2, kFocalPx * height / height_px};
  return view;
}

std::string bench_pixel_filter(const PixelFilterBench& options) {
  const auto chosen = cli::chosen_workloads("pixel_filter", options.figures, kFigures);
  for (const double height : options.heights_px) {
    if (!(height >= 8 && height <= 2048))
      throw UserError("hsi4d bench pixel_filter: a height of " + number_text(height) + " px; allowed: 8 to 2048");
  }
  std::string json;
  Table table{.head = {"", "sigma px", "blur px2", "width px", "half px", "size px", "light %", "rms", "distance %"},
              .align = "lr"};
  const auto report = [&](const FilterMeasurement& m) {
    const SilhouetteError& e = m.error;
    table.rows.push_back({m.name, Cell(m.sigma_px, 2), Cell(m.blur, 4), formatted("%+.3f", e.width_px),
                          formatted("%+.3f", e.half_width_px), formatted("%+.3f", m.distance_error * m.height_px),
                          formatted("%+.2f", 100 * e.brightness), Cell(e.rms, 4),
                          formatted("%+.2f", 100 * m.distance_error)});
    json += filter_row(m);
  };
  for (const NamedFigure& named : chosen) {
    const PosedGaussians figure = filter_figure(named.gaussians);
    for (const double height : options.heights_px)
      for (const TrueSilhouette& truth : kTruths)
        with_threads(options.threads, [&] { FigureBench(named.name, figure, height, report).against(truth); });
  }
  if (!options.json.empty()) write_text_file(options.json, json);
  return table_text(table);
}

namespace cli {
namespace {

void add_pixel_filter(CLI::App& command, Program& program) {
  PixelFilterBench& options = program.options<PixelFilterBench>();
  add_workload(command, options.figures, "figures");
  add_thread_count(command, options.threads, "1");
  add_json(command, options.json);
  command.add_option("--height", options.heights_px, "Heights of the figures, px; default: 32 to 512")
      ->check(CLI::Range(8.0, 2048.0));
  run_when_chosen(command, program, [&] { return bench_pixel_filter(options); });
}

}  // namespace

BenchTopic pixel_filter_topic() {
  return {.name = "pixel_filter",
          .summary = "Measure what the renderer's low-pass does to silhouettes",
          .add = add_pixel_filter};
}

}  // namespace cli

}  // namespace hsi4d
