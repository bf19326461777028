#include "bench/pareto.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <thread>

#include "bench/timing.h"
#include "core/check.h"
#include "core/held_isa.h"
#include "core/parallel.h"
#include "core/random.h"
#include "core/stopwatch.h"
#include "core/text.h"
#include "pipelines/draw/reference_render.h"
#include "pipelines/draw/taped_scene.h"

namespace hsi4d {

namespace {

// --- settings --------------------------------------------------------------------------------------------------------

struct NamedValue {
  const char* name;
  double value;
};
constexpr std::array<NamedValue, 4> kAlphaMins = {
    {{"1/512", 1.0 / 512}, {"1/1024", 1.0 / 1024}, {"1e-4", 1e-4}, {"0", 0}}};
constexpr std::array<NamedValue, 5> kStops = {
    {{"1e-2", 1e-2}, {"1e-3", 1e-3}, {"1e-4", 1e-4}, {"1e-6", 1e-6}, {"0", 0}}};
constexpr std::array<NamedValue, 4> kCaps = {
    {{"0.99", kAlphaCapCompatible}, {"0.999", 0.999}, {"1-2^-12", kAlphaCap}, {"1", kNoAlphaCap}}};
/// Of the product: the knobs whose values trade time for error, without those that no preset would take.
constexpr std::array<NamedValue, 4> kProductAlphaMins = {
    {{"1/512", 1.0 / 512}, {"1/1024", 1.0 / 1024}, {"1e-4", 1e-4}, {"2e-6", kAlphaMinAccurate}}};
constexpr std::array<NamedValue, 4> kProductStops = {{{"1e-2", 1e-2}, {"1e-3", 1e-3}, {"1e-4", 1e-4}, {"1e-6", 1e-6}}};

ParetoSetting preset(Quality quality, const char* name) {
  ParetoSetting setting{"quality", name, {}};
  apply_quality(setting.settings, quality);
  return setting;
}

void append_presets(std::vector<ParetoSetting>& all) {
  for (const ConfigChoice<Quality>& q : kQualities) {
    if (q.value == Quality::kDefault) all.insert(all.begin(), preset(q.value, q.name));
    if (q.value != Quality::kDefault) all.push_back(preset(q.value, q.name));
  }
}

/// The default with one knob turned.
template <class F>
void append(std::vector<ParetoSetting>& all, const char* knob, const std::string& value, const F& turn) {
  ParetoSetting setting{knob, value, {}};
  turn(setting);
  all.push_back(std::move(setting));
}

void append_thresholds(std::vector<ParetoSetting>& all) {
  for (const NamedValue& v : kAlphaMins)
    append(all, "alpha_min", v.name, [&v](ParetoSetting& s) { s.settings.alpha_min = v.value; });
  for (const ConfigChoice<StopRule>& rule : kStopRules) {
    for (const NamedValue& v : kStops) {
      if (rule.value == StopRule::kInclusive && v.value == kTransmittanceStop) continue;  // the default
      append(all, "transmittance_stop", std::string(v.name) + " " + rule.name, [&v, &rule](ParetoSetting& s) {
        s.settings.transmittance_stop = v.value;
        s.settings.stop_rule = rule.value;
      });
    }
  }
  for (const NamedValue& v : kCaps) {
    append(all, "alpha_cap", v.name, [&v](ParetoSetting& s) {
      s.settings.alpha_cap = v.value;
      s.model = ParetoModel::kUncapped;
    });
  }
}

void append_others(std::vector<ParetoSetting>& all) {
  append(all, "footprint", "square_3sigma", [](ParetoSetting& s) { s.settings.footprint = Footprint::kSquare3Sigma; });
  append(all, "precision", "double", [](ParetoSetting& s) { s.precision = Precision::kDouble; });
  append(all, "tile", "8", [](ParetoSetting& s) { s.settings.tile = 8; });
  for (int degree = 0; degree < kHighestShDegree; ++degree)
    append(all, "sh_degree", std::to_string(degree), [degree](ParetoSetting& s) { s.settings.sh_degree = degree; });
}

void append_machine(std::vector<ParetoSetting>& all) {
  for (const Isa isa : {Isa::kBaseline, Isa::kAvx2, Isa::kAvx512}) {
    if (isa <= best_isa()) append(all, "isa", isa_name(isa), [isa](ParetoSetting& s) { s.isa = isa; });
  }
  const std::set<int> counts = {2, std::max(2, static_cast<int>(std::thread::hardware_concurrency()))};
  for (const int count : counts)
    append(all, "threads", std::to_string(count), [count](ParetoSetting& s) { s.threads = count; });
}

void append_product(std::vector<ParetoSetting>& all) {
  for (const NamedValue& alpha_min : kProductAlphaMins) {
    for (const NamedValue& stop : kProductStops) {
      if (stop.value == kTransmittanceStop && alpha_min.value != kAlphaMinAccurate) continue;  // alpha_min alone
      append(all, "product", std::string("alpha_min ") + alpha_min.name + ", stop " + stop.name, [&](ParetoSetting& s) {
        s.settings.alpha_min = alpha_min.value;
        s.settings.transmittance_stop = stop.value;
      });
    }
  }
}

// --- truth -----------------------------------------------------------------------------------------------------------

constexpr std::uint64_t kCotangentSeed = 41;

/// [H,W,3] standard normals.
std::vector<double> random_cotangent(const Camera& camera) {
  RandomSequence random(kCotangentSeed);
  std::vector<double> cotangent(3 * static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height));
  for (double& x : cotangent) x = random.normal();
  return cotangent;
}

/// The scene without cuts, by brute force; for every cap that is asked for once.
class Truth {
 public:
  Truth(const ParetoScene& scene, const std::vector<double>& cotangent) : scene_(scene), cotangent_(cotangent) {}

  const SceneGradients& of(const ParetoSetting& setting) {
    SceneView view;
    view.camera = scene_.camera;
    view.settings.alpha_min = 0;
    view.settings.transmittance_stop = 0;
    view.settings.alpha_cap = setting.model == ParetoModel::kUncapped ? kNoAlphaCap : setting.settings.alpha_cap;
    const auto found = by_cap_.find(view.settings.alpha_cap);
    if (found != by_cap_.end()) return found->second;
    const auto cotangent_of = [this](SceneGradients&) { return cotangent_; };
    return by_cap_.emplace(view.settings.alpha_cap, adjoint_reference(scene_.gaussians, view, cotangent_of))
        .first->second;
  }

 private:
  const ParetoScene& scene_;
  const std::vector<double>& cotangent_;
  std::map<double, SceneGradients> by_cap_;
};

// --- a kept tape -----------------------------------------------------------------------------------------------------

struct Seconds {
  double forward = 0, backward = 0;

  double both() const { return forward + backward; }
};

/// A scene on a tape, to be run again and again.
struct KeptScene {
  Isa isa = Isa::kBaseline;
  int threads = 1;
  std::function<Seconds()> pass;  ///< from the numbers to the image, and back
  std::function<SceneGradients()> result;
  std::shared_ptr<const RenderCounters> counters;

  /// With the instruction set and the threads that are asked for.
  Seconds run() const {
    const HeldIsa held(isa);
    Seconds seconds;
    with_threads(threads, [&] { seconds = pass(); });
    return seconds;
  }
};

template <class S>
KeptScene keep_as(const ParetoScene& scene, const SceneView& view, const std::vector<double>& cotangent) {
  const auto taped = std::make_shared<TapedScene<S>>(PosedGaussians{scene.gaussians, {}}, view, false);
  KeptScene kept;
  kept.counters = taped->rendered.counters;
  kept.pass = [taped, planes = planar<S>(cotangent)] {
    for (const Var<S> leaf : {taped->means, taped->quats, taped->log_scales, taped->logits, taped->sh, taped->xi})
      taped->tape.write(leaf);  // as if it had changed
    Seconds seconds;
    Stopwatch watch;
    taped->tape.forward(taped->rendered.image);
    seconds.forward = watch.lap();
    taped->tape.backward(taped->rendered.image, planes);
    seconds.backward = watch.lap();
    return seconds;
  };
  kept.result = [taped] {
    SceneGradients result;
    result.rendered.image = interleaved(taped->tape.value(taped->rendered.image));
    taped->copy_gradients(result);
    return result;
  };
  return kept;
}

KeptScene keep(const ParetoScene& scene, const ParetoSetting& setting, int threads,
               const std::vector<double>& cotangent) {
  const SceneView view{.camera = scene.camera, .settings = setting.settings, .precision = setting.precision};
  KeptScene kept = setting.precision == Precision::kDouble ? keep_as<double>(scene, view, cotangent)
                                                           : keep_as<float>(scene, view, cotangent);
  kept.isa = setting.isa.value_or(best_isa());
  kept.threads = setting.threads > 0 ? setting.threads : threads;
  return kept;
}

template <class Part>
RunTimes times_of(const std::vector<Seconds>& runs, const Part& part) {
  std::vector<double> values;
  for (const Seconds& s : runs) values.push_back(std::invoke(part, s));
  return {median_of(values), *std::min_element(values.begin(), values.end())};
}

/// Runs both in turns, after one that warms up.
void measure_times(const KeptScene& kept, const KeptScene& usual, int repeats, ParetoRow& row) {
  std::vector<Seconds> mine, others;
  std::vector<double> forward, backward, both;
  kept.run();
  usual.run();
  for (int i = 0; i < repeats; ++i) {
    others.push_back(usual.run());
    mine.push_back(kept.run());
    const Seconds &a = mine.back(), &b = others.back();
    forward.push_back(a.forward / b.forward);
    backward.push_back(a.backward / b.backward);
    both.push_back(a.both() / b.both());
  }
  row.repeats = repeats;
  row.forward = times_of(mine, &Seconds::forward);
  row.backward = times_of(mine, &Seconds::backward);
  row.both = times_of(mine, &Seconds::both);
  if (&kept == &usual) return;
  row.forward_ratio = median_of(forward);
  row.backward_ratio = median_of(backward);
  row.time_ratio = median_of(both);
}

bool is_measured(const ParetoScene& scene, const ParetoSetting& setting) {
  return !scene.is_extreme || setting.knob == "quality";
}

void measure_scene(const ParetoScene& scene, const ParetoBench& bench, const std::function<void(ParetoRow)>& add) {
  const std::vector<double> cotangent = random_cotangent(scene.camera);
  const KeptScene usual = keep(scene, pareto_settings().front(), bench.threads, cotangent);
  Truth truth(scene, cotangent);
  for (const ParetoSetting& setting : bench.settings) {
    if (!is_measured(scene, setting)) continue;
    const bool is_usual = setting.name() == pareto_settings().front().name();
    const KeptScene other = is_usual ? KeptScene{} : keep(scene, setting, bench.threads, cotangent);
    const KeptScene& kept = is_usual ? usual : other;
    ParetoRow row{.scene = scene.name, .is_extreme = scene.is_extreme, .knob = setting.knob, .value = setting.value};
    row.model = setting.model;
    row.isa = kept.isa;
    row.threads = kept.threads;
    measure_times(kept, usual, bench.repeats, row);
    row.gaussians = scene.gaussians.count();
    row.pixels = static_cast<Index>(scene.camera.width) * scene.camera.height;
    row.fragments = kept.counters->fragments;
    row.pairs = kept.counters->pairs;
    const SceneGradients result = kept.result();
    with_threads(bench.threads, [&] {
      const SceneGradients& reference = truth.of(setting);
      row.image = image_error(result.rendered.image, reference.rendered.image);
      row.gradients = gradient_errors(result, reference);
    });
    add(std::move(row));
  }
}

}  // namespace

const std::vector<ParetoSetting>& pareto_settings() {
  static const std::vector<ParetoSetting> all = [] {
    std::vector<ParetoSetting> made;
    append_presets(made);
    append_thresholds(made);
    append_others(made);
    append_product(made);
    append(made, "depth_key", "double", [](ParetoSetting& s) { s.settings.depth_key = DepthKey::kDouble; });
    append_machine(made);
    return made;
  }();
  return all;
}

bool is_machine_knob(const std::string& knob) { return knob == "isa" || knob == "threads"; }

std::vector<std::string> pareto_knobs() {
  std::vector<std::string> knobs;
  for (const ParetoSetting& setting : pareto_settings())
    if (std::find(knobs.begin(), knobs.end(), setting.knob) == knobs.end()) knobs.push_back(setting.knob);
  return knobs;
}

Index pareto_row_count(const ParetoBench& bench) {
  Index count = 0;
  for (const ParetoScene& scene : bench.scenes)
    count += std::count_if(bench.settings.begin(), bench.settings.end(),
                           [&scene](const ParetoSetting& setting) { return is_measured(scene, setting); });
  return count;
}

std::vector<ParetoRow> measure_pareto(const ParetoBench& bench, const std::function<void(const ParetoRow&)>& told) {
  std::vector<ParetoRow> rows;
  for (const ParetoScene& scene : bench.scenes) {
    measure_scene(scene, bench, [&](ParetoRow row) {
      rows.push_back(std::move(row));
      if (told) told(rows.back());
    });
  }
  return rows;
}

}  // namespace hsi4d
