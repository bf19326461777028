// `hsi4d bench scaling`: the time of an iteration against the size of what is reconstructed.
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "bench/list.h"
#include "bench/scaling.h"
#include "core/file.h"
#include "core/parallel.h"
#include "core/progress.h"
#include "pipelines/cli/terminal.h"

namespace hsi4d::cli {

namespace {

struct BenchScalingOptions : BenchConfigOptions {
  std::vector<std::string> axes;  ///< "scene", "scene=1000,2000"; empty: all
  int threads = 0;                ///< of all axes but `threads`; 0: what the config says
  int repeats = 20;               ///< iterations of a stage that are measured, of all rounds
};

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

/// Measures the points of every axis; a point that several axes share is measured once. Every point's config is read
/// before the first is measured. Returns a table.
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

void add_scaling(CLI::App& command, Program& program) {
  BenchScalingOptions& scaling = program.options<BenchScalingOptions>();
  add_config(command, scaling, "The config that is run", "configs/bench/paper_scale.json");
  add_thread_count(command, scaling.threads, "what the config says");
  command
      .add_option("--repeats", scaling.repeats, "Iterations of each stage, of which the median is told; default: 20")
      ->check(CLI::Range(1, 1000));
  command
      .add_option("--axis", scaling.axes, "scene, avatar, image or threads, with its values or without; default: all")
      ->type_name("AXIS[=N,N...]");
  run_when_chosen(command, program, [&] { return bench_scaling_command(scaling, program.terms); });
}

}  // namespace

BenchTopic scaling_topic() {
  return {.name = "scaling",
          .summary = "Measure an iteration against the size of what is reconstructed",
          .add = add_scaling};
}

}  // namespace hsi4d::cli
