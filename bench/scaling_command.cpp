#include "bench/scaling_command.h"

#include <map>

#include "bench/scaling.h"
#include "core/file.h"
#include "core/parallel.h"
#include "core/progress.h"
#include "pipelines/cli/terminal.h"

namespace hsi4d::cli {

namespace {

/// What of a config the axes change, by which points are the same.
using PointKey = std::vector<Index>;

PointKey key_of(const RunConfig& config) {
  const SyntheticSettings& s = config.synthetic;
  return {s.scene_gaussians, s.avatar_gaussians, s.size_px, config.threads > 0 ? config.threads : thread_count()};
}

RunConfig config_at(const BenchScalingOptions& options, const std::vector<LossTerm>& losses, const ScalingAxis& axis,
                    Index value) {
  std::vector<std::string> overrides = options.overrides;
  if (options.threads > 0) overrides.push_back("threads=" + std::to_string(options.threads));
  overrides.push_back(axis.setting + "=" + std::to_string(value));
  return load_run_config(options.config, overrides, descriptions_of(losses), ConfigUse::kStages);
}

}  // namespace

std::string bench_scaling_command(const BenchScalingOptions& options, const std::vector<LossTerm>& losses) {
  std::vector<ScalingResult> results;
  std::vector<RunConfig> configs;
  std::map<PointKey, std::size_t> place_of;      // in configs
  std::vector<std::vector<std::size_t>> places;  // by axis and value
  for (const ScalingAxis& axis : chosen_axes(options.axes)) {
    results.push_back({axis, {}});
    places.emplace_back();
    for (const Index value : axis.values) {
      RunConfig config = config_at(options, losses, axis, value);
      const auto [entry, is_new] = place_of.emplace(key_of(config), configs.size());
      if (is_new) configs.push_back(std::move(config));
      places.back().push_back(entry->second);
    }
  }
  const Observer observer = observer_on_terminal(false);
  Progress shown("points", kScalingRounds * std::ssize(configs), observer.progress, observer.progress_interval);
  const std::vector<ScalingPoint> points =
      measure_scaling(configs, losses, options.repeats, [&shown] { shown.step(); });
  shown.finish();
  for (std::size_t a = 0; a < results.size(); ++a) {
    for (std::size_t p = 0; p < places[a].size(); ++p) {
      results[a].points.push_back(points[places[a][p]]);
      results[a].points.back().value = results[a].axis.values[p];
    }
  }
  if (!options.json.empty()) write_text_file(options.json, scaling_json(results));
  const std::string title = "time of an iteration, " + configs.front().name;
  if (!options.plot.empty()) write_text_file(options.plot, scaling_svg(results, title));
  return scaling_table(results);
}

}  // namespace hsi4d::cli
