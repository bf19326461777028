// The arguments of `hsi4d bench`.
#pragma once

#include <string>
#include <vector>

#include "bench/command.h"
#include "bench/pareto_command.h"
#include "bench/scaling_command.h"
#include "bench/stages_command.h"
#include "bench/topics.h"
#include "optim/loss_term.h"
#include "pipelines/cli/program_commands.h"

namespace hsi4d::cli {

/// The command with its arguments.
struct BenchCommands : ProgramCommands {
  std::string topic;
  BenchOptions bench;
  BenchTopicOptions bench_topic_options;
  BenchStagesOptions bench_stages;
  BenchScalingOptions bench_scaling;
  BenchParetoOptions bench_pareto;

  explicit BenchCommands(const std::vector<LossTerm>& terms);
  void describe_for_help() override;

 private:
  void add_bench_measuring(CLI::App& command);
  void add_bench_runs(CLI::App& command);
  void add_bench_pareto(CLI::App& command);
  /// @param threads  that were asked for; 0: none
  std::string run_bench(int threads, const std::vector<LossTerm>& terms);
};

}  // namespace hsi4d::cli
