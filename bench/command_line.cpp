#include "bench/command_line.h"

#include <CLI/CLI.hpp>

#include "core/text.h"
#include "pipelines/cli/options.h"
#include "splat/files/splat_file.h"

namespace hsi4d::cli {

BenchCommands::BenchCommands(const std::vector<LossTerm>& terms) {
  CLI::App* command =
      app->add_subcommand("bench",
                          "Measure the speed of the renderer, the body, the tape or a whole run, time against "
                          "error, or the pixel filter: a table, and one JSON object a measurement");
  command
      ->add_option("TOPIC", topic,
                   "What: " + joined(bench_topic_names()) + "; default: the kernels, which are " +
                       joined(kernel_topics()) + ". `hsi4d bench TOPIC --help` explains each")
      ->check(CLI::IsMember(bench_topic_names()));
  add_bench_measuring(*command);
  add_bench_runs(*command);
  add_bench_pareto(*command);
  command->callback([this, command, &terms] {
    bench_topic_options.refuse_others(topic);
    const int threads = command->count("--threads") > 0 ? bench.threads : 0;
    if (command->count("--repeats") > 0) bench_scaling.repeats = bench.repeats;
    if (command->count("--config") > 0) bench_pareto.config = bench_stages.config;
    if (command->count("--out") > 0) bench_pareto.out = bench_stages.out;
    run = [this, threads, &terms] { return run_bench(threads, terms); };
  });
}

void BenchCommands::add_bench_measuring(CLI::App& command) {
  BenchTopicOptions& of = bench_topic_options;
  // Without a topic it is refused by the kernels, which say what to do instead.
  of.add(command.add_option("--workload", bench.workloads),
         {{kernel_topics(), "only these workloads; default: all"},
          {{"pixel_filter"}, "only these figures; default: all"},
          {{"pareto"}, "only these of the scenes that are made up; default: all"}});
  of.add(command.add_option("--threads", bench.threads)->check(CLI::Range(1, 1024)),
         {{{"rasterize", "skinning", "color_net", "pixel_filter", "pareto"}, "threads; default: 1"},
          {{"stages", "scaling"}, "threads; default: what the config says"},
          {{"tape"}, "1, always"}});
  std::vector<std::string> repeated = kernel_topics();
  repeated.emplace_back("pareto");
  of.add(command.add_option("--repeats", bench.repeats)->check(CLI::Range(1, 1000)),
         {{repeated, "runs of each, of which the median is told; default: 9"},
          {{"scaling"}, "iterations of each stage, of which the median is told; default: 20"}});
  of.add(command.add_option("--height", bench.heights_px)->check(CLI::Range(8.0, 2048.0)),
         {{{"pixel_filter"}, "heights of the figures, px; default: 32 to 512"}});
  of.add(command.add_option("--json", bench.json)->type_name("F"),
         {{bench_topic_names(), "file for the measurements, one JSON object a line"}});
}

void BenchCommands::add_bench_runs(CLI::App& command) {
  const std::vector<std::string> of_runs = {"stages", "scaling", "pareto"};
  BenchTopicOptions& of = bench_topic_options;
  of.add(command.add_option("--config", bench_stages.config)->type_name("F.json"),
         {{{"stages", "scaling"}, "the config that is run; default: configs/bench/paper_scale.json"},
          {{"pareto"}, "the config of the reconstructions; default: configs/bench/pareto_tracking.json"}});
  of.add(add_several(command, "--set", bench_stages.overrides, "")->type_name("KEY=VALUE"),
         {{of_runs, "change one setting of the config: render.blur=0.1. The value is JSON, or else text"}});
  of.add(command.add_option("--out", bench_stages.out)->type_name("DIR"),
         {{{"stages"}, "folder of dataset and runs; default: runs/bench/CONFIG"},
          {{"pareto"},
           "folder that is made for datasets and reconstructions and removed again; default: runs/bench/pareto"}});
  of.add(command.add_option("--plot", bench_stages.plot)->type_name("F.svg"), {{of_runs, "file for a picture"}});
  of.add(command.add_option("--axis", bench_scaling.axes)->type_name("AXIS[=N,N...]"),
         {{{"scaling"}, "scene, avatar, image or threads, with its values or without; default: all"}});
  of.add(command.add_flag("--compare", bench_stages.compare),
         {{{"stages"}, "run again without skips, and tell the ratio"}});
}

void BenchCommands::add_bench_pareto(CLI::App& command) {
  const std::vector<std::string> pareto = {"pareto"};
  BenchParetoOptions& o = bench_pareto;
  BenchTopicOptions& of = bench_topic_options;
  of.add(command.add_option("--csv", o.csv)->type_name("F.csv"), {{pareto, "file for the measurements, a line each"}});
  of.add(command.add_option("--front", o.front)->type_name("F.svg"),
         {{pareto, "file for a picture of what settings are chosen by, two panels"}});
  of.add(
      command.add_option("--scene", o.scene_files)->type_name("F.ply|DIR"),
      {{pareto, std::string("Gaussians of a file to measure too, or of all files in a folder, instead of all that are "
                            "made up unless --workload names some; ") +
                    kSplatFormats}});
  of.add(command.add_option("--knob", o.knobs), {{pareto, "only these and the default; default: all"}});
  of.add(command.add_option("--seeds", o.seeds)->check(CLI::Range(0, 100)),
         {{pareto, "reconstructions of each setting; default: 5; 0 leaves these out"}});
}

void BenchCommands::describe_for_help() {
  const CLI::App* const chosen = app->get_subcommands().empty() ? nullptr : app->get_subcommands().front();
  if (chosen == nullptr || chosen->get_name() != "bench") return;
  const std::vector<std::string> words = chosen->get_option("TOPIC")->results();
  if (!words.empty()) bench_topic_options.describe_topic(words.front(), *app->get_subcommand("bench"));
}

std::string BenchCommands::run_bench(int threads, const std::vector<LossTerm>& terms) {
  if (topic == "stages") {
    bench_stages.json = bench.json;
    bench_stages.threads = threads;
    return bench_stages_command(bench_stages, terms);
  }
  if (topic == "scaling") {
    bench_scaling.config = bench_stages.config;
    bench_scaling.overrides = bench_stages.overrides;
    bench_scaling.threads = threads;
    bench_scaling.json = bench.json;
    bench_scaling.plot = bench_stages.plot;
    return bench_scaling_command(bench_scaling, terms);
  }
  if (topic == "pareto") {
    bench_pareto.scenes = bench.workloads;
    bench_pareto.overrides = bench_stages.overrides;
    bench_pareto.threads = bench.threads;
    bench_pareto.repeats = bench.repeats;
    bench_pareto.json = bench.json;
    bench_pareto.plot = bench_stages.plot;
    return bench_pareto_command(bench_pareto, terms);
  }
  if (topic == "skinning") return bench_skinning_command(bench);
  if (topic == "color_net") return bench_color_net_command(bench);
  if (topic == "tape") return bench_tape_command(bench);
  if (topic.empty()) return bench_kernels_command(bench);
  return topic == "rasterize" ? bench_rasterize_command(bench) : bench_pixel_filter_command(bench);
}

}  // namespace hsi4d::cli
