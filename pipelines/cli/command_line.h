// The program's arguments: which there are, what they mean, and what is done with them. With the files beside it the
// only one that includes CLI11.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "optim/loss_term.h"
#include "pipelines/cli/avatar_command.h"
#include "pipelines/cli/avatar_fit_command.h"
#include "pipelines/cli/bench_command.h"
#include "pipelines/cli/bench_pareto_command.h"
#include "pipelines/cli/bench_scaling_command.h"
#include "pipelines/cli/bench_stages_command.h"
#include "pipelines/cli/bench_topics.h"
#include "pipelines/cli/commands.h"
#include "pipelines/cli/convert_command.h"
#include "pipelines/cli/demo_command.h"
#include "pipelines/cli/evaluate_command.h"
#include "pipelines/cli/failure.h"
#include "pipelines/cli/gradcheck_command.h"
#include "pipelines/cli/gradients_command.h"
#include "pipelines/cli/info_command.h"
#include "pipelines/cli/motion_command.h"
#include "pipelines/cli/pose_command.h"
#include "pipelines/cli/render_command.h"
#include "pipelines/cli/report_command.h"
#include "pipelines/cli/run_command.h"
#include "pipelines/cli/select_camera_command.h"
#include "pipelines/cli/stress_command.h"
#include "pipelines/cli/study_command.h"
#include "pipelines/cli/sweep_command.h"
#include "pipelines/cli/synth_command.h"

namespace CLI {
class App;
class Option;
class Validator;
}  // namespace CLI

namespace hsi4d::cli {

/// Refuses what is no whole number from 0 on, in words.
CLI::Validator whole_number(std::int64_t most = std::numeric_limits<std::int64_t>::max());

/// The subcommands with their arguments; `run` is what the chosen one does.
struct CommandLine {
  std::unique_ptr<CLI::App> app;
  std::string config, topic, file, out, kind = "run";
  std::vector<std::string> overrides, runs;
  bool print_config = false, quiet = false, json = false;
  AvatarOptions avatar;
  ConvertOptions convert;
  RunArguments run_arguments;
  DemoArguments demo_arguments;
  std::vector<LossDescription> losses;
  RenderOptions render;
  GradientsOptions gradients;
  PoseOptions pose;
  MotionOptions motion;
  BenchOptions bench;
  BenchTopicOptions bench_topic_options;
  BenchStagesOptions bench_stages;
  BenchScalingOptions bench_scaling;
  StressOptions stress;
  GradcheckArguments gradcheck;
  BenchParetoOptions bench_pareto;
  SelectCameraOptions select_camera;
  EvaluateOptions evaluate;
  StudyOptions study;
  SweepArguments sweep;
  RunOneArguments run_one;
  std::function<std::string()> run;
  int status = kDone;  ///< that `run` leaves

  explicit CommandLine(const std::vector<LossTerm>& terms);
  ~CommandLine();
  /// Before help is shown: that of a topic of `bench` is of its own options alone.
  void describe_for_help();
  CommandLine(const CommandLine&) = delete;
  CommandLine& operator=(const CommandLine&) = delete;

 private:
  // command_line_runs.cpp
  void add_run(const std::vector<LossTerm>& terms);
  void add_demo(const std::vector<LossTerm>& terms);
  void add_synth();
  void add_select_camera();
  void add_evaluate();
  /// What is solid, and where objects are.
  void add_evaluate_scene(CLI::App& command);
  void add_report();
  void add_study();
  void add_sweep(const std::vector<LossTerm>& terms);
  void add_run_one(const std::vector<LossTerm>& terms);
  // command_line_tools.cpp
  void add_info();
  void add_avatar(const std::vector<LossTerm>& terms);
  void add_convert();
  void add_render();
  void add_gradients();
  void add_pose();
  void add_motion();
  /// Returns the option --scene.
  CLI::Option* add_scene(CLI::App& command, SceneOptions& options);
  // command_line_bench.cpp
  void add_stress();
  void add_gradcheck(const std::vector<LossTerm>& terms);
  void add_bench(const std::vector<LossTerm>& terms);
  void add_bench_measuring(CLI::App& command);
  void add_bench_runs(CLI::App& command);
  void add_bench_pareto(CLI::App& command);
  /// @param threads  that were asked for; 0: none
  std::string run_bench(int threads, const std::vector<LossTerm>& terms);
  // command_line.cpp
  void add_check();
  void add_schema();
  void add_list();
  static void add_threads(CLI::App& command, std::optional<int>& threads);
  static void add_overrides(CLI::App& command, std::vector<std::string>& overrides);
  /// An option that may be given several times, with one value each time.
  static CLI::Option* add_several(CLI::App& command, const std::string& name, std::vector<std::string>& values,
                                  const std::string& description);
};

}  // namespace hsi4d::cli
