// The subcommands `hsi4d sweep` and `hsi4d run-one`: many runs from one file, and one of them.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "optim/loss_term.h"

namespace hsi4d::cli {

struct SweepArguments {
  std::string sweep;  ///< a sweep's file, the plan that a folder holds, or the folder
  std::string out;    ///< empty: runs/NAME, or the folder of the plan
  std::string launcher = "local";
  int jobs = 0;                ///< 0: as many as there are threads for; of Slurm what the sweep says
  std::optional<int> threads;  ///< of all runs together, of Slurm of each; none or 0: one a core
  double memory_mb = 0;        ///< of all runs together; 0: most of what is free
  bool fail_fast = false;
  bool resume = false;
  bool dry_run = false;
};

struct RunOneArguments {
  std::string sweep;
  std::int64_t index = 0;
  std::string out;
  std::optional<int> threads;
  int parent = 0;        ///< the process that has started this one and with which it ends; 0: none
  bool requeue = false;  ///< after SIGUSR1 the job of Slurm is put into the queue again
};

/// Carries out a sweep, or submits it. Returns the tables of results, the plan with dry_run.
/// @param status  receives the exit status where runs have failed
std::string sweep_command(const SweepArguments& arguments, const std::vector<LossTerm>& losses, int& status);

/// Carries out one run of a sweep. Returns its table of errors.
/// @param status  receives the exit status where another process computes the run and nobody waits for that
std::string run_one_command(const RunOneArguments& arguments, const std::vector<LossTerm>& losses, int& status);

}  // namespace hsi4d::cli
