#include "bench/command_line.h"

#include <CLI/CLI.hpp>

#include "core/check.h"
#include "pipelines/cli/options.h"
#include "splat/files/splat_file.h"

namespace hsi4d::cli {
namespace {

void add_workload(CLI::App& command, std::vector<std::string>& names, const char* what) {
  command.add_option("--workload", names, std::string("Only these ") + what + "; default: all");
}

void add_thread_count(CLI::App& command, int& threads, const char* usual) {
  command.add_option("--threads", threads, std::string("Threads; default: ") + usual)->check(CLI::Range(1, 1024));
}

void add_repeats(CLI::App& command, int& repeats) {
  command.add_option("--repeats", repeats, "Runs of each, of which the median is told; default: 9")
      ->check(CLI::Range(1, 1000));
}

void add_json(CLI::App& command, std::string& file) {
  command.add_option("--json", file, "File for the measurements, one JSON object a line")->type_name("F");
}

/// What topics that run a config have.
template <class Options>
void add_run(CLI::App& command, Options& options, const char* config) {
  command.add_option("--config", options.config, config)->type_name("F.json");
  add_overrides(command, options.overrides);
  command.add_option("--plot", options.plot, "File for a picture")->type_name("F.svg");
  add_json(command, options.json);
}

}  // namespace

BenchCommands::BenchCommands(const std::vector<LossTerm>& terms) {
  CLI::App& bench = *app->add_subcommand(
      "bench",
      "Measure the speed of the renderer, the body, the tape or a whole run, time against error, or the pixel filter: "
      "a table, and one JSON object a measurement. Without a topic: rasterize, skinning, color_net and tape");
  add_thread_count(bench, kernels.threads, "1");
  add_repeats(bench, kernels.repeats);
  add_json(bench, kernels.json);
  const auto add_kernel = [&](const char* name, const char* summary, std::string (*measure)(const BenchOptions&)) {
    CLI::App& command = add_topic(bench, name, summary, [this, measure] { return measure(kernels); });
    const bool is_of_figures = measure == bench_pixel_filter_command;
    add_workload(command, kernels.workloads, is_of_figures ? "figures" : "workloads");
    if (measure != bench_tape_command) add_thread_count(command, kernels.threads, "1");
    if (!is_of_figures) add_repeats(command, kernels.repeats);
    add_json(command, kernels.json);
    return &command;
  };
  add_kernel("rasterize", "Measure every step of the renderer, forward and backward", bench_rasterize_command);
  add_kernel("skinning", "Measure the body: skinning and its gradient, of vertices and of Gaussians",
             bench_skinning_command);
  add_kernel("color_net", "Measure the color net, forward and backward", bench_color_net_command);
  add_kernel("tape", "Measure what a node of the tape costs, and lambda losses against their values alone",
             bench_tape_command);
  add_kernel("pixel_filter", "Measure what the renderer's low-pass does to silhouettes", bench_pixel_filter_command)
      ->add_option("--height", kernels.heights_px, "Heights of the figures, px; default: 32 to 512")
      ->check(CLI::Range(8.0, 2048.0));
  add_stages(bench, terms);
  add_scaling(bench, terms);
  add_pareto(bench, terms);
  bench.callback([this, &bench] {
    if (!run) run = [this] { return bench_kernels_command(kernels); };
    const auto is_given = [&bench](const char* option) { return bench.count(option) > 0; };
    if (!bench.get_subcommands().empty() && (is_given("--threads") || is_given("--repeats") || is_given("--json")))
      throw UserError("hsi4d bench: options stand behind the topic, which has its own");
  });
}

/// Adds a topic; what it measures is told at the end.
CLI::App& BenchCommands::add_topic(CLI::App& bench, const std::string& name, const std::string& summary,
                                   std::function<std::string()> measure) {
  CLI::App& command = *bench.add_subcommand(name, summary);
  command.callback([this, measure = std::move(measure)] { run = measure; });
  return command;
}

void BenchCommands::add_stages(CLI::App& bench, const std::vector<LossTerm>& terms) {
  CLI::App& command = add_topic(bench, "stages", "Measure a run, operator by operator",
                                [this, &terms] { return bench_stages_command(stages, terms); });
  add_run(command, stages, "The config that is run; default: configs/bench/paper_scale.json");
  add_thread_count(command, stages.threads, "what the config says");
  command.add_option("--out", stages.out, "Folder of dataset and runs; default: runs/bench/CONFIG")->type_name("DIR");
  command.add_flag("--compare", stages.compare, "Run again without skips, and tell the ratio");
}

void BenchCommands::add_scaling(CLI::App& bench, const std::vector<LossTerm>& terms) {
  CLI::App& command = add_topic(bench, "scaling", "Measure an iteration against the size of what is reconstructed",
                                [this, &terms] { return bench_scaling_command(scaling, terms); });
  add_run(command, scaling, "The config that is run; default: configs/bench/paper_scale.json");
  add_thread_count(command, scaling.threads, "what the config says");
  command
      .add_option("--repeats", scaling.repeats, "Iterations of each stage, of which the median is told; default: 20")
      ->check(CLI::Range(1, 1000));
  command
      .add_option("--axis", scaling.axes, "scene, avatar, image or threads, with its values or without; default: all")
      ->type_name("AXIS[=N,N...]");
}

void BenchCommands::add_pareto(CLI::App& bench, const std::vector<LossTerm>& terms) {
  CLI::App& command =
      add_topic(bench, "pareto",
                "Measure run time against error, setting by setting, and what an error comes to in a reconstruction",
                [this, &terms] { return bench_pareto_command(pareto, terms); });
  add_workload(command, pareto.scenes, "of the scenes that are made up");
  command
      .add_option(
          "--scene", pareto.scene_files,
          std::string("Gaussians of a file to measure too, or of all files in a folder, instead of all that are "
                      "made up unless --workload names some; ") +
              kSplatFormats)
      ->type_name("F.ply|DIR");
  command.add_option("--knob", pareto.knobs, "Only these and the default; default: all");
  add_thread_count(command, pareto.threads, "1");
  add_repeats(command, pareto.repeats);
  command.add_option("--seeds", pareto.seeds, "Reconstructions of each setting; default: 5; 0 leaves these out")
      ->check(CLI::Range(0, 100));
  add_run(command, pareto, "The config of the reconstructions; default: configs/bench/pareto_tracking.json");
  command
      .add_option("--out", pareto.out,
                  "Folder that is made for datasets and reconstructions and removed again; default: runs/bench/pareto")
      ->type_name("DIR");
  command.add_option("--csv", pareto.csv, "File for the measurements, a line each")->type_name("F.csv");
  command.add_option("--front", pareto.front, "File for a picture of what settings are chosen by, two panels")
      ->type_name("F.svg");
}

}  // namespace hsi4d::cli
