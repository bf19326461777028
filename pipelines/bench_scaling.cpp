#include "pipelines/bench_scaling.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "core/check.h"
#include "core/parallel.h"
#include "core/suggest.h"
#include "core/text.h"
#include "pipelines/bench_measurement.h"
#include "pipelines/frame_images.h"
#include "pipelines/reconstruct_stage.h"
#include "pipelines/synthetic.h"
#include "pipelines/synthetic_chain.h"
#include "pipelines/synthetic_motion.h"
#include "pipelines/synthetic_render.h"

namespace hsi4d {

namespace {

// --- axes ------------------------------------------------------------------------------------------------------------

[[noreturn]] void refuse(const std::string& word, const std::string& text) {
  throw UserError("hsi4d bench scaling: --axis " + word + ": " + text);
}

/// "1000,2000".
std::vector<Index> numbers_in(const std::string& list, const std::string& word) {
  std::vector<Index> numbers;
  for (std::size_t begin = 0; begin <= list.size();) {
    const std::size_t end = std::min(list.find(',', begin), list.size());
    Index number = 0;
    const auto [rest, error] = std::from_chars(list.data() + begin, list.data() + end, number);
    if (error != std::errc() || rest != list.data() + end || number < 1)
      refuse(word, "\"" + list.substr(begin, end - begin) +
                       "\" is no number of 1 or more; write whole numbers apart by "
                       "commas: scene=100000,500000");
    numbers.push_back(number);
    begin = end + 1;
  }
  std::sort(numbers.begin(), numbers.end());
  numbers.erase(std::unique(numbers.begin(), numbers.end()), numbers.end());
  return numbers;
}

const ScalingAxis& axis_named(const std::string& name, const std::string& word) {
  std::vector<std::string> known;
  for (const ScalingAxis& axis : scaling_axes()) {
    if (axis.name == name) return axis;
    known.push_back(axis.name);
  }
  refuse(word, "there is no axis \"" + name + "\"; known: " + joined(known) + did_you_mean(name, known));
}

// --- what is measured ------------------------------------------------------------------------------------------------

/// A generated clip of two frames in memory: the clip without its video, its second frame, and the state before it.
struct Filmed {
  Clip clip;
  ClipFrame frame;
  SceneState start;  ///< frame 0's, with the camera of frame 1: as the camera stage would have left it
};

Filmed film(const RunConfig& config) {
  SyntheticSettings settings = config.synthetic;
  settings.frames = 2;
  settings.clips = 1;
  const BodyModel body = rest_body(config.body);
  AvatarSettings of_avatar;
  of_avatar.gaussians = settings.avatar_gaussians;
  of_avatar.seed = static_cast<std::uint64_t>(settings.seed);
  const Avatar avatar = surface_avatar(body, of_avatar);
  const SyntheticObject object = synthetic_object(settings);
  const SyntheticClip truth = synthetic_clip(body, object, clip_settings(settings));
  SceneSetup setup = setup_in({synthetic_scene(settings, truth.plan), object, avatar}, truth);

  const RenderSettings render = video_render_settings();
  const SyntheticRenderer renderer(setup.scene, object.gaussians, avatar, render);
  SyntheticFrame seen =
      renderer.frame(truth.motion.poses[1], object.exists() ? truth.object[1] : Rigid<double>(), truth.cameras[1], 1);
  Filmed filmed;
  filmed.frame = {std::move(seen.color), std::move(seen.human_mask), {}};
  if (object.exists()) filmed.frame.object_masks.push_back(std::move(seen.object_mask));
  Clip& clip = filmed.clip;
  clip.scene = std::move(setup.scene);
  clip.objects = std::move(setup.objects);
  clip.avatar = std::move(setup.avatar);
  clip.camera = truth.cameras[0];
  clip.first = {clip.camera.camera_from_world, setup.poses, truth.motion.poses[0]};
  clip.frame_rate = settings.frame_rate;
  filmed.start = clip.first;
  filmed.start.camera_from_world = truth.cameras[1].camera_from_world;
  return filmed;
}

/// What the iterations of a stage told.
struct Told {
  std::vector<double> seconds, prepare, forward, backward;
  RenderCounters sum;
  double first_ms = 0;

  void hear(const IterationReport& report, const RenderCounters& counters) {
    if (report.iteration == 0) first_ms = 1e3 * report.seconds;
    if (report.iteration < kWarmIterations) return;
    const RenderTimes& t = counters.times;
    seconds.push_back(report.seconds);
    prepare.push_back(t.still_s + t.records_s + t.sort_s + t.bin_s);
    forward.push_back(t.forward_s);
    backward.push_back(t.backward_s + t.reduce_s);
    sum += counters;
    sum.channels = counters.channels;
  }
};

double median_ms(std::vector<double> seconds) {
  std::sort(seconds.begin(), seconds.end());
  return 1e3 * seconds[seconds.size() / 2];
}

ScalingCost cost_of(const std::string& name, const StageSettings& stage, const Told& told) {
  const auto mean = [&told](Index sum) { return (sum + std::ssize(told.seconds) / 2) / std::ssize(told.seconds); };
  ScalingCost cost;
  cost.stage = name;
  cost.moves_camera = find_entry(stage.optimize, "camera") != nullptr;
  cost.draws_all = stage.draw == Draw::kAll;
  cost.ms = median_ms(told.seconds);
  cost.first_ms = told.first_ms;
  cost.prepare_ms = median_ms(told.prepare);
  cost.forward_ms = median_ms(told.forward);
  cost.backward_ms = median_ms(told.backward);
  cost.channels = told.sum.channels;
  cost.tiles = mean(told.sum.tiles);
  cost.pairs = mean(told.sum.pairs);
  cost.fragments = mean(told.sum.fragments);
  return cost;
}

/// The config with as many iterations as are measured, in all of which everything moves.
RunConfig measured_config(RunConfig config, int repeats) {
  for (auto& [name, stage] : config.stages) {
    stage.iterations = kWarmIterations + repeats;
    for (auto& [group, settings] : stage.optimize) {
      settings.from = 0;
      settings.until.reset();
    }
  }
  return config;
}

ScalingPoint measured_here(const RunConfig& config, const std::vector<LossTerm>& losses) {
  const Filmed filmed = film(config);
  Image covered(1, filmed.clip.camera.height, filmed.clip.camera.width);
  add_covered(filmed.frame, config.data, covered);
  ScalingPoint point;
  point.threads = thread_count();
  point.scene_gaussians = filmed.clip.scene.count();
  point.avatar_gaussians = filmed.clip.avatar.count();
  for (const ClipObject& object : filmed.clip.objects) point.object_gaussians += object.gaussians.count();
  for (std::size_t s = 0; s < config.stages.size(); ++s) {
    const auto& [name, stage] = config.stages[s];
    if (stage.over == StageScope::kSequence) continue;
    SceneState state = stage.draw == Draw::kAll ? filmed.start : filmed.clip.first;
    ColorState colors = first_color_state(first_color_net(config.color_net, filmed.clip.avatar, config.seed));
    Told told;
    run_frame_stage({config, filmed.clip, losses, s}, {1, filmed.frame, covered, {&filmed.clip.first, 1}}, state,
                    colors, [&told](const auto& report, const auto& counters) { told.hear(report, counters); });
    point.stages.push_back(cost_of(name, stage, told));
  }
  if (point.stages.empty()) throw UserError("hsi4d bench scaling: the config has no stage that draws a frame");
  point.peak_memory_bytes = peak_memory_bytes();
  return point;
}

// --- growth ----------------------------------------------------------------------------------------------------------

/// What was expected before anything was measured (docs/numerics/speed.md).
struct Expectation {
  const char* axis;
  const char* quantity;
  bool draws_all;
  double exponent;
  const char* reason;
};
constexpr std::array<Expectation, 24> kExpectations = {{
    {"scene", "ms", false, 0.7, "records, projection, colours of each; the pixels' part stays"},
    {"scene", "pairs", false, 0.9, "most Gaussians are smaller than a tile and reach one"},
    {"scene", "fragments", false, 0.2, "the same surfaces; footprints end at the blur of half a pixel"},
    {"scene", "ms", true, 0.2, "what stands is kept; what of it is seen beside what moves is composited"},
    {"scene", "pairs", true, 0.4, "those of what moves stay, those behind it grow"},
    {"scene", "fragments", true, 0.1, "the same surfaces behind the same human"},
    {"avatar", "ms", false, 0, "it is not drawn"},
    {"avatar", "pairs", false, 0, "it is not drawn"},
    {"avatar", "fragments", false, 0, "it is not drawn"},
    {"avatar", "ms", true, 0.4, "posing, records, color net of each; object, losses, pixels stay"},
    {"avatar", "pairs", true, 0.35, "one or two for each, beside those of object and scene"},
    {"avatar", "fragments", true, 0.15, "the same surface; footprints end at the blur of half a pixel"},
    {"image", "ms", false, 0.55, "each Gaussian's part stays; compositing and loss grow with pixels"},
    {"image", "pairs", false, 0.4, "a tile shows less, so that large Gaussians reach more of them"},
    {"image", "fragments", false, 1.7, "pixels; in small images the blur widens every footprint"},
    {"image", "ms", true, 0.6, "as in the camera's stage, and losses over touched squares"},
    {"image", "pairs", true, 0.5, "a tile shows less, so that more Gaussians reach several"},
    {"image", "fragments", true, 1.7, "pixels; in small images the blur widens every footprint"},
    {"threads", "ms", false, -0.9, "all that is long is done on every thread"},
    {"threads", "pairs", false, 0, "results do not depend on it"},
    {"threads", "fragments", false, 0, "results do not depend on it"},
    {"threads", "ms", true, -0.8, "short loops, between which threads wait for each other"},
    {"threads", "pairs", true, 0, "results do not depend on it"},
    {"threads", "fragments", true, 0, "results do not depend on it"},
}};

/// None for stages of another kind: those that draw the scene and move the camera, or draw all and leave it.
const Expectation* expectation_of(const std::string& axis, const std::string& quantity, const ScalingCost& cost) {
  if (cost.moves_camera == cost.draws_all) return nullptr;
  const auto is_it = [&](const Expectation& e) {
    return e.axis == axis && e.quantity == quantity && e.draws_all == cost.draws_all;
  };
  const auto* const place = std::find_if(kExpectations.begin(), kExpectations.end(), is_it);
  return place == kExpectations.end() ? nullptr : place;
}

/// Least squares of log y over log x: {exponent, scale}; none where there is no line.
std::optional<std::pair<double, double>> power_law(const std::vector<std::pair<double, double>>& points) {
  double x = 0, y = 0, xx = 0, xy = 0;
  const auto n = static_cast<double>(points.size());
  for (const auto& [value, quantity] : points) {
    if (!(value > 0 && quantity > 0)) return std::nullopt;
    const double u = std::log(value), v = std::log(quantity);
    x += u, y += v, xx += u * u, xy += u * v;
  }
  const double spread = n * xx - x * x;
  if (points.size() < 2 || !(spread > 0)) return std::nullopt;
  const double exponent = (n * xy - x * y) / spread;
  return std::pair{exponent, std::exp((y - exponent * x) / n)};
}

double quantity_of(const ScalingCost& cost, const std::string& name) {
  if (name == "ms") return cost.ms;
  return static_cast<double>(name == "pairs" ? cost.pairs : cost.fragments);
}

}  // namespace

const std::vector<ScalingAxis>& scaling_axes() {
  static const std::vector<ScalingAxis> all = {
      {"scene", "synthetic.scene_gaussians", "Gaussians of the scene", {100000, 200000, 500000, 1000000, 2000000}},
      {"avatar", "synthetic.avatar_gaussians", "Gaussians of the human", {10000, 30000, 100000, 300000}},
      {"image", "synthetic.size_px", "width and height of the image, px", {256, 512, 1024, 2048}},
      {"threads", "threads", "threads", {1, 2}}};
  return all;
}

std::vector<ScalingAxis> chosen_axes(const std::vector<std::string>& words) {
  if (words.empty()) return scaling_axes();
  std::vector<ScalingAxis> axes;
  for (const std::string& word : words) {
    const std::size_t end = word.find('=');
    ScalingAxis axis = axis_named(word.substr(0, end), word);
    if (end != std::string::npos) axis.values = numbers_in(word.substr(end + 1), word);
    const auto is_it = [&axis](const ScalingAxis& other) { return other.name == axis.name; };
    if (std::any_of(axes.begin(), axes.end(), is_it)) refuse(word, "the axis was named before");
    axes.push_back(std::move(axis));
  }
  return axes;
}

ScalingPoint measure_scaling(const RunConfig& config, const std::vector<LossTerm>& losses, int repeats) {
  const RunConfig measured = measured_config(config, repeats);
  ScalingPoint point;
  with_threads(config.threads > 0 ? config.threads : thread_count(), [&] { point = measured_here(measured, losses); });
  return point;
}

std::vector<ScalingFit> scaling_fits(const ScalingAxis& axis, const std::vector<ScalingPoint>& points) {
  std::vector<ScalingFit> fits;
  if (points.empty()) return fits;
  for (std::size_t s = 0; s < points.front().stages.size(); ++s) {
    for (const char* quantity : {"ms", "pairs", "fragments"}) {
      std::vector<std::pair<double, double>> measured;
      for (const ScalingPoint& point : points)
        measured.emplace_back(static_cast<double>(point.value), quantity_of(point.stages[s], quantity));
      ScalingFit fit{points.front().stages[s].stage, quantity, {}, {}, 0, ""};
      if (const Expectation* expected = expectation_of(axis.name, quantity, points.front().stages[s])) {
        fit.expected = expected->exponent;
        fit.reason = expected->reason;
      }
      if (const auto law = power_law(measured)) {
        fit.fitted = law->first;
        fit.scale = law->second;
      }
      fits.push_back(std::move(fit));
    }
  }
  return fits;
}

}  // namespace hsi4d
