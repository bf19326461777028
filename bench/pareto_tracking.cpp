#include "bench/pareto_tracking.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <nlohmann/json.hpp>

#include "bench/scaling.h"
#include "core/check.h"
#include "core/table.h"
#include "core/text.h"
#include "pipelines/run/run.h"
#include "pipelines/synthetic/dataset.h"

namespace hsi4d {

namespace {

namespace fs = std::filesystem;

constexpr int kTimedIterations = 30;  // of a stage, by which its cost is known

/// The config with a setting's knobs; blur, near plane and the like are the config's.
RunConfig config_with(const RunConfig& config, const ParetoSetting& setting) {
  RunConfig result = config;
  const RenderSettings& from = setting.settings;
  RenderSettings& to = result.render;
  to.quality = from.quality;
  to.alpha_cap = from.alpha_cap;
  to.alpha_min = from.alpha_min;
  to.transmittance_stop = from.transmittance_stop;
  to.stop_rule = from.stop_rule;
  to.footprint = from.footprint;
  to.sh_degree = from.sh_degree;
  to.depth_key = from.depth_key;
  to.tile = from.tile;
  result.precision = setting.precision == Precision::kDouble ? RunPrecision::kDouble : RunPrecision::kFloat;
  result.threads = 1;
  return result;
}

bool draws_a_frame(const StageSettings& stage) { return stage.over == StageScope::kFrame; }

/// Iterations of a frame, in all stages that draw one.
Index iterations_of(const RunConfig& config) {
  Index sum = 0;
  for (const auto& [name, stage] : config.stages) sum += draws_a_frame(stage) ? stage.iterations : 0;
  return sum;
}

/// Processor milliseconds of a frame's iterations.
double cost_of(const RunConfig& config, const ScalingPoint& measured) {
  double cost = 0;
  for (const auto& [name, stage] : config.stages)
    for (const ScalingCost& one : measured.stages)
      if (one.stage == name) cost += static_cast<double>(stage.iterations) * one.processor_ms;
  return cost;
}

/// So many times the iterations; what is on from or until an iteration keeps its share.
RunConfig stretched(RunConfig config, double factor) {
  const auto scaled = [factor](Index count) {
    return static_cast<int>(std::lround(factor * static_cast<double>(count)));
  };
  for (auto& [name, stage] : config.stages) {
    if (!draws_a_frame(stage)) continue;
    stage.iterations = std::max(1, scaled(stage.iterations));
    for (auto& [group, settings] : stage.optimize) {
      settings.from = scaled(settings.from);
      if (settings.until) settings.until = scaled(*settings.until);
    }
  }
  return config;
}

/// A folder that is not there yet, and is gone at the end.
class PassingFolder {
 public:
  explicit PassingFolder(const fs::path& path) : path_(path) { check_tracking_folder(path); }
  PassingFolder(const PassingFolder&) = delete;
  PassingFolder& operator=(const PassingFolder&) = delete;
  ~PassingFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }

 private:
  fs::path path_;
};

/// A setting and a budget.
struct Job {
  RunConfig config;
  TrackedPoint point;
  std::array<std::vector<double>, kTrackedErrors.size()> values = {};  ///< by kTrackedErrors, a seed each
};

std::vector<Job> jobs_of(const Tracking& tracking, const std::vector<LossTerm>& losses) {
  std::vector<RunConfig> configs;
  for (const ParetoSetting& setting : tracking.settings) configs.push_back(config_with(tracking.config, setting));
  const std::vector<ScalingPoint> measured = measure_scaling(configs, losses, kTimedIterations);
  std::vector<Job> jobs;
  for (std::size_t i = 0; i < configs.size(); ++i) {
    const ParetoSetting& setting = tracking.settings[i];
    TrackedPoint point{.knob = setting.knob, .value = setting.value, .seeds = tracking.seeds};
    point.cost_ratio = cost_of(configs[i], measured[i]) / cost_of(configs[0], measured[0]);
    point.iterations = iterations_of(configs[i]);
    jobs.push_back({configs[i], point});
    const RunConfig as_long = stretched(configs[i], 1 / point.cost_ratio);
    point.is_fixed_time = true;
    point.iterations = iterations_of(as_long);
    jobs.push_back({as_long, point});
  }
  return jobs;
}

void run_job(Job& job, const fs::path& dataset, const fs::path& folder, int seed, const std::vector<LossTerm>& losses) {
  RunConfig config = job.config;
  config.seed = seed;
  config.data = dataset_inputs(dataset);
  RunOptions options;
  options.folder = folder.string();
  options.threads = 1;
  const RunSummary summary = execute_run(config, losses, options);
  for (std::size_t m = 0; m < kTrackedErrors.size(); ++m)
    if (const double* value = find_metric(summary.metrics.back().values, kTrackedErrors[m].metric))
      job.values[m].push_back(*value);
  fs::remove_all(folder);
}

TrackedPoint::Spread spread_of(const std::vector<double>& values) {
  TrackedPoint::Spread spread;
  const auto count = static_cast<double>(values.size());
  for (const double value : values) spread.mean += value / count;
  double squares = 0;
  for (const double value : values) squares += (value - spread.mean) * (value - spread.mean);
  if (values.size() > 1) spread.deviation = std::sqrt(squares / (count - 1));
  return spread;
}

std::string spread_text(const TrackedPoint::Spread& spread, int decimals) {
  return formatted("%.*f +- %.*f", decimals, spread.mean, decimals, spread.deviation);
}

}  // namespace

void check_tracking_folder(const fs::path& folder) {
  if (fs::exists(folder))
    throw UserError(folder.string() + ": is there; hsi4d bench pareto makes this folder and removes it again (--out)");
}

Index tracking_run_count(const Tracking& tracking) { return 2 * std::ssize(tracking.settings) * tracking.seeds; }

std::vector<TrackedPoint> measure_tracking(const Tracking& tracking, const std::vector<LossTerm>& losses,
                                           const std::function<void()>& told) {
  const PassingFolder passing(tracking.folder);
  std::vector<Job> jobs = jobs_of(tracking, losses);
  for (int seed = 0; seed < tracking.seeds; ++seed) {
    const fs::path dataset = tracking.folder / ("data-" + std::to_string(seed));
    SyntheticSettings synthetic = tracking.config.synthetic;
    synthetic.seed = seed;
    write_dataset(synthetic, video_render_settings(), dataset, {}, ConfigValue::make_object(), tracking.config.body);
    for (Job& job : jobs) {
      run_job(job, dataset, tracking.folder / "run", seed, losses);
      if (told) told();
    }
  }
  std::vector<TrackedPoint> points;
  for (Job& job : jobs) {
    for (std::size_t m = 0; m < kTrackedErrors.size(); ++m)
      job.point.*kTrackedErrors[m].place = spread_of(job.values[m]);
    points.push_back(job.point);
  }
  return points;
}

std::string tracking_table(const std::vector<TrackedPoint>& points) {
  std::string text;
  for (const bool is_fixed_time : {false, true}) {
    Table table{.head = {"", "time", "steps", "joints mm", "world mm", "object cm", "camera cm", "camera deg"},
                .align = "lr"};
    for (const TrackedPoint& p : points) {
      if (p.is_fixed_time != is_fixed_time) continue;
      table.rows.push_back({p.name(), Cell(p.cost_ratio, 2), p.iterations, spread_text(p.joints_mm, 2),
                            spread_text(p.world_mm, 2), spread_text(p.object_cm, 2), spread_text(p.camera_cm, 3),
                            spread_text(p.camera_deg, 4)});
    }
    text += (text.empty() ? "" : "\n") +
            std::string(is_fixed_time ? "reconstruction, as long as the default's" : "reconstruction, as many steps") +
            "\n" + table_text(table);
  }
  return text;
}

std::string tracking_json(const std::vector<TrackedPoint>& points) {
  std::string text;
  for (const TrackedPoint& p : points) {
    nlohmann::ordered_json line = {{"tracking", p.budget()},     {"knob", p.knob},
                                   {"value", p.value},           {"cost_ratio", p.cost_ratio},
                                   {"iterations", p.iterations}, {"seeds", p.seeds}};
    for (const TrackedError& told : kTrackedErrors) {
      const TrackedPoint::Spread& spread = p.*told.place;
      line[told.metric] = {{"mean", spread.mean}, {"deviation", spread.deviation}};
    }
    text += line.dump() + "\n";
  }
  return text;
}

}  // namespace hsi4d
