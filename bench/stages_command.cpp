// `hsi4d bench stages`: a run whose operators are timed.
#include <chrono>
#include <filesystem>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "bench/heap_counter.h"
#include "bench/list.h"
#include "bench/skips.h"
#include "bench/stages.h"
#include "core/file.h"
#include "core/memory.h"
#include "core/parallel.h"
#include "core/stopwatch.h"
#include "pipelines/cli/dataset.h"
#include "pipelines/cli/run_command.h"
#include "pipelines/cli/terminal.h"

namespace hsi4d::cli {

namespace {

struct BenchStagesOptions : BenchConfigOptions {
  std::string out;       ///< folder of dataset and run; empty: runs/bench/NAME
  int threads = 0;       ///< 0: what the config says
  bool compare = false;  ///< run again without skips, and tell the ratio
  bool curvature = false;
};

/// Iterations of a stage in the run without skips, at most.
constexpr int kIterationsWithoutSkips = 20;

namespace fs = std::filesystem;

fs::path free_folder(const fs::path& folder) {
  fs::path free = folder / "run";
  for (int number = 2; fs::exists(free); ++number) free = folder / ("run-" + std::to_string(number));
  return free;
}

/// Dataset and settings of what is to be measured.
RunConfig measured_config(const BenchStagesOptions& options, const std::vector<LossTerm>& losses, const fs::path& out) {
  RunConfig config = load_run_config(options.config, options.overrides, descriptions_of(losses), ConfigUse::kStages);
  if (!config.data.scene.empty()) return load_run_config(options.config, options.overrides, descriptions_of(losses));
  const fs::path dataset = out / "dataset";
  if (fs::exists(dataset)) {
    check_dataset(config, dataset);
  } else {
    make_dataset(config, losses, dataset, options.threads, false);
  }
  name_inputs(dataset, config.data);
  return config;
}

/// What a run took, and its table of errors.
struct MeasuredRun {
  RunCost cost;
  std::string result;
};

MeasuredRun measured_run(const RunConfig& config, const BenchStagesOptions& options,
                         const std::vector<LossTerm>& losses, const fs::path& out) {
  RunCost cost;
  const StageWatch watch{[&cost](const StageProfile& profile) { add_profile(profile, cost.stages); },
                         heap_allocation_counter(), options.curvature};
  cost.threads = options.threads > 0 ? options.threads : config.threads > 0 ? config.threads : thread_count();
  RunOptions run;
  run.folder = free_folder(out).string();
  run.threads = options.threads;
  run.observer = observer_on_terminal(false);
  run.observer.stages = &watch;
  const auto start = std::chrono::steady_clock::now();
  const RunSummary summary = run_on_terminal(config, losses, run, out.string());
  cost.seconds = seconds_since(start);
  cost.peak_memory_bytes = peak_memory_bytes();
  return {cost, result_text(summary, run.folder)};
}

/// Carries out a run of the config into the first free OUT/run, OUT/run-2, …; of a generated dataset, which is made in
/// OUT/dataset unless it is there, where the config names no data; with `compare` then one without skips. Returns the
/// tables.
std::string bench_stages_command(const BenchStagesOptions& options, const std::vector<LossTerm>& losses) {
  const fs::path out = options.out.empty() ? fs::path("runs/bench") / options.config.stem() : fs::path(options.out);
  const RunConfig config = measured_config(options, losses, out);
  const MeasuredRun with = measured_run(config, options, losses, out);
  std::string table = cost_table(with.cost) + "\n" + with.result;
  std::string json = cost_json(with.cost);
  if (options.compare) {
    const RunCost without = measured_run(without_skips(config, kIterationsWithoutSkips), options, losses, out).cost;
    table += "\n" + comparison_table(with.cost, without);
    json += comparison_json(with.cost, without);
  }
  if (!options.json.empty()) write_text_file(options.json, json);
  if (!options.plot.empty()) write_text_file(options.plot, cost_svg(with.cost, "an iteration of " + config.name));
  return table;
}

void add_stages(CLI::App& command, Program& program) {
  BenchStagesOptions& stages = program.options<BenchStagesOptions>();
  add_config(command, stages, "The config that is run", "configs/bench/paper_scale.json");
  add_thread_count(command, stages.threads, "what the config says");
  command.add_option("--out", stages.out, "Folder of dataset and runs; default: runs/bench/CONFIG")->type_name("DIR");
  command.add_flag("--compare", stages.compare, "Run again without skips, and tell the ratio");
  command.add_flag("--curvature", stages.curvature,
                   "Also time one Gauss-Newton matrix a frame; its time and memory are the run's too");
  run_when_chosen(command, program, [&] { return bench_stages_command(stages, program.terms); });
}

}  // namespace

BenchTopic stages_topic() {
  return {.name = "stages", .summary = "Measure a run, operator by operator", .add = add_stages};
}

}  // namespace hsi4d::cli
