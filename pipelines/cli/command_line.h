// The program's arguments: which there are, what they mean, and what is done with them.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "optim/loss_term.h"
#include "pipelines/cli/avatar_command.h"
#include "pipelines/cli/avatar_fit_command.h"
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
#include "pipelines/cli/program_commands.h"
#include "pipelines/cli/render_command.h"
#include "pipelines/cli/report_command.h"
#include "pipelines/cli/run_command.h"
#include "pipelines/cli/select_camera_command.h"
#include "pipelines/cli/study_command.h"
#include "pipelines/cli/sweep_command.h"
#include "pipelines/cli/synth_command.h"

namespace CLI {
class Option;
}

namespace hsi4d::cli {

/// The subcommands with their arguments; `run` is what the chosen one does.
struct CommandLine : ProgramCommands {
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
  GradcheckArguments gradcheck;
  SelectCameraOptions select_camera;
  EvaluateOptions evaluate;
  StudyOptions study;
  SweepArguments sweep;
  RunOneArguments run_one;

  explicit CommandLine(const std::vector<LossTerm>& terms);

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
  // command_line.cpp
  void add_gradcheck(const std::vector<LossTerm>& terms);
  void add_check();
  void add_schema();
  void add_list();
};

}  // namespace hsi4d::cli
