// Commands that measure the program itself.
#include <CLI/CLI.hpp>

#include "core/text.h"
#include "pipelines/cli/command_line.h"

namespace hsi4d::cli {

void CommandLine::add_stress() {
  CLI::App* command = app->add_subcommand("stress",
                                          "Try every known way to fail: a row each, with what was measured, what is "
                                          "allowed, and what it would be without the remedy");
  command->add_option("--row", stress.rows, "Only these: A1, or a letter for its group; default: all")->type_name("ID");
  add_threads(*command, stress.threads);
  command->add_option("--json", stress.json, "File for the figures, one JSON object a row")->type_name("F");
  command->add_flag("--functions", stress.functions,
                    "Instead: how far off exponentials, sigmoid, sines, rotations and harmonics are, in units in "
                    "the last place, on each instruction set");
  command->add_option("--points", stress.points, "Of --functions: arguments a row, 1000 or more")
      ->check(CLI::Range(Index(1000), Index(1) << 30))
      ->type_name("N");
  command->footer("Exit status: 1 when a row fails, or holds without its remedy too.");
  command->callback([this] {
    run = [this] {
      StressOutcome outcome = stress_command(stress);
      status = outcome.status;
      return outcome.text;
    };
  });
}

void CommandLine::add_gradcheck(const std::vector<LossTerm>& terms) {
  GradcheckArguments& a = gradcheck;
  CLI::App* command = app->add_subcommand(
      "gradcheck",
      "Check the gradient of a stage, its whole loss by each parameter group, against differences in double");
  command->add_option("CONFIG", a.config, "The config file, with its data")->required();
  command->add_option("--stage", a.check.stage, "Which of its stages")->type_name("S")->required();
  add_overrides(*command, a.overrides);
  command->add_option("--frame", a.check.frame, "The frame, of a stage over frames; default: 3, or the last of fewer")
      ->check(whole_number())
      ->type_name("I");
  command
      ->add_option("--entries", a.check.entries,
                   "Numbers that are tried of each array, at random; each takes six renders or more")
      ->capture_default_str()
      ->check(CLI::Range(1, 1000000))
      ->type_name("N");
  command->add_option("--seed", a.check.seed, "Which numbers these are, and the disturbance")
      ->capture_default_str()
      ->check(whole_number())
      ->type_name("N");
  add_threads(*command, a.threads);
  command->add_option("--json", a.json, "File for the figures, one JSON object a group")->type_name("F");
  command->footer(
      "The state is that in which the frame would begin, every number of the groups disturbed by up to 0.01.\n"
      "Numbers at a kink (Gaussians change places, a pixel is just reached) are told and judge nothing.\n"
      "It is quick in small images: --set approx.longest_side_px=64.\n"
      "Exit status: 1 when a gradient is wrong, or too many kinks leave it open.");
  command->callback([this, &terms] { run = [this, &terms] { return gradcheck_command(gradcheck, terms, status); }; });
}

void CommandLine::add_bench(const std::vector<LossTerm>& terms) {
  CLI::App* command =
      app->add_subcommand("bench",
                          "Measure the speed of the renderer, the body, the tape or a whole run, time against "
                          "error, or the pixel filter: a table, and one JSON object a measurement");
  const std::vector<std::string> topics = {"rasterize",    "skinning", "color_net", "tape",
                                           "pixel_filter", "stages",   "scaling",   "pareto"};
  command
      ->add_option("TOPIC", topic,
                   "What: " + joined(topics) + "; default: the kernels, which are rasterize, skinning, color_net, tape")
      ->check(CLI::IsMember(topics));
  command->add_option("--workload", bench.workloads, "Of a topic: only these; default: all; not of stages and scaling");
  command
      ->add_option("--threads", bench.threads,
                   "Threads; default: 1, of stages and scaling what the config says; of tape 1 always")
      ->check(CLI::Range(1, 1024));
  command
      ->add_option(
          "--repeats", bench.repeats,
          "Runs of each, of which the median is told; default: 9, of scaling 20; not of pixel_filter and stages")
      ->check(CLI::Range(1, 1000));
  command->add_option("--height", bench.heights_px, "Heights of the figures of pixel_filter, px; default: 32 to 512")
      ->check(CLI::Range(8.0, 2048.0));
  command->add_option("--json", bench.json, "File for the measurements, one JSON object a line");
  command->add_option("--config", bench_stages.config, "Of stages, scaling and pareto: the config that is run")
      ->type_name("F.json");
  command->add_option("--out", bench_stages.out,
                      "Of stages: folder of dataset and runs; default: runs/bench/CONFIG. Of pareto: folder that is "
                      "made for those of the reconstructions and removed again; default: runs/bench/pareto");
  command->add_option("--plot", bench_stages.plot, "Of stages, scaling and pareto: file for a picture")
      ->type_name("F.svg");
  add_bench_pareto(*command);
  command
      ->add_option("--axis", bench_scaling.axes,
                   "Of scaling: scene, avatar, image or threads, with its values or without; default: all")
      ->type_name("AXIS[=N,N...]");
  command->add_flag("--compare", bench_stages.compare, "Of stages: run again without skips, and tell the ratio");
  add_overrides(*command, bench_stages.overrides);
  command->callback([this, command, &terms] {
    const int threads = command->count("--threads") > 0 ? bench.threads : 0;
    if (command->count("--repeats") > 0) bench_scaling.repeats = bench.repeats;
    if (command->count("--config") > 0) bench_pareto.config = bench_stages.config;
    if (command->count("--out") > 0) bench_pareto.out = bench_stages.out;
    run = [this, threads, &terms] { return run_bench(threads, terms); };
  });
}

void CommandLine::add_bench_pareto(CLI::App& command) {
  BenchParetoOptions& o = bench_pareto;
  command.add_option("--csv", o.csv, "Of pareto: file for the measurements, a line each")->type_name("F.csv");
  command.add_option("--front", o.front, "Of pareto: file for a picture of what settings are chosen by, two panels")
      ->type_name("F.svg");
  command
      .add_option(
          "--scene", o.scene_files,
          std::string("Of pareto: Gaussians of a file to measure too, or of all files in a folder, instead of all "
                      "that are made up unless --workload names some; ") +
              kSplatFormats)
      ->type_name("F.ply|DIR");
  command.add_option("--knob", o.knobs, "Of pareto: only these and the default; default: all");
  command.add_option("--seeds", o.seeds, "Of pareto: reconstructions of each setting; default: 5; 0 leaves these out")
      ->check(CLI::Range(0, 100));
}

std::string CommandLine::run_bench(int threads, const std::vector<LossTerm>& terms) {
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
