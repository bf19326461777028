#include "pipelines/cli/bench_scaling_command.h"

#include <map>

#include "core/file.h"
#include "core/parallel.h"
#include "core/progress.h"
#include "pipelines/bench_scaling.h"
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
  const std::vector<ScalingAxis> axes = chosen_axes(options.axes);
  std::vector<std::vector<RunConfig>> configs;
  std::map<PointKey, ScalingPoint> measured;
  for (const ScalingAxis& axis : axes) {
    configs.emplace_back();
    for (const Index value : axis.values) {
      configs.back().push_back(config_at(options, losses, axis, value));
      measured[key_of(configs.back().back())];
    }
  }
  const Observer observer = observer_on_terminal(false);
  Progress shown("points", std::ssize(measured), observer.progress, observer.progress_interval);
  std::vector<ScalingResult> results;
  for (std::size_t a = 0; a < axes.size(); ++a) {
    results.push_back({axes[a], {}});
    for (std::size_t p = 0; p < configs[a].size(); ++p) {
      ScalingPoint& point = measured[key_of(configs[a][p])];
      if (point.stages.empty()) {
        point = measure_scaling(configs[a][p], losses, options.repeats);
        shown.step();
      }
      results.back().points.push_back(point);
      results.back().points.back().value = axes[a].values[p];
    }
  }
  shown.finish();
  if (!options.json.empty()) write_text_file(options.json, scaling_json(results));
  const std::string title = "milliseconds an iteration, " + configs.front().front().name;
  if (!options.plot.empty()) write_text_file(options.plot, scaling_svg(results, title));
  return scaling_table(results);
}

}  // namespace hsi4d::cli
