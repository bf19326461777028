// The arguments of `hsi4d bench`: a command a topic.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "bench/command.h"
#include "bench/pareto_command.h"
#include "bench/scaling_command.h"
#include "bench/stages_command.h"
#include "optim/loss_term.h"
#include "pipelines/cli/program_commands.h"

namespace hsi4d::cli {

/// The command with its topics.
struct BenchCommands : ProgramCommands {
  BenchOptions kernels;
  BenchStagesOptions stages;
  BenchScalingOptions scaling;
  BenchParetoOptions pareto;

  explicit BenchCommands(const std::vector<LossTerm>& terms);

 private:
  CLI::App& add_topic(CLI::App& bench, const std::string& name, const std::string& summary,
                      std::function<std::string()> measure);
  void add_stages(CLI::App& bench, const std::vector<LossTerm>& terms);
  void add_scaling(CLI::App& bench, const std::vector<LossTerm>& terms);
  void add_pareto(CLI::App& bench, const std::vector<LossTerm>& terms);
};

}  // namespace hsi4d::cli
