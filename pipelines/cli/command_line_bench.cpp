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

void CommandLine::add_bench_measuring(CLI::App& command) {
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

void CommandLine::add_bench_runs(CLI::App& command) {
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

void CommandLine::add_bench_pareto(CLI::App& command) {
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

void CommandLine::describe_for_help() {
  const CLI::App* const chosen = app->get_subcommands().empty() ? nullptr : app->get_subcommands().front();
  if (chosen == nullptr || chosen->get_name() != "bench") return;
  const std::vector<std::string> words = chosen->get_option("TOPIC")->results();
  if (!words.empty()) bench_topic_options.describe_topic(words.front(), *app->get_subcommand("bench"));
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
