// `hsi4d run`: a reconstruction as a config describes it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "optim/loss_term.h"
#include "pipelines/chain/summary.h"
#include "pipelines/run/run.h"

namespace hsi4d::cli {

struct RunArguments {
  std::filesystem::path config;
  std::vector<std::string> overrides;
  std::string out;  ///< empty: the first of runs/NAME, runs/NAME-2, … that is free
  bool resume = false;
  bool quiet = false;
  std::optional<int> threads;  ///< 0: one a core; none: what the config says
  std::optional<std::int64_t> seed;
  bool dry_run = false;
  bool print_config = false;
};

/// Carries out the run and returns what stdout gets: the table of errors and where the results are; the resolved config
/// with print_config, the plan with dry_run (then nothing is written).
std::string run_command(const RunArguments& arguments, const std::vector<LossTerm>& losses);

/// A run that ends in good order on Ctrl-C, and then tells how to go on.
/// @param out  what --out must be to go on with it later
RunSummary run_on_terminal(const RunConfig& config, const std::vector<LossTerm>& losses, const RunOptions& options,
                           const std::string& out);

/// Threads as RunOptions has them, of a command line's.
int run_threads(std::optional<int> asked);

/// runs/NAME, or the first of runs/NAME-2, … that is not there.
std::string free_run_folder(const std::string& name);

/// The table of errors, the time and where the report is.
std::string result_text(const RunSummary& summary, const std::string& folder);

/// The errors of a chain's clips, at its joins, and over all.
std::string chain_result_text(const ChainSummary& summary, const std::string& folder);

}  // namespace hsi4d::cli
