// `hsi4d run`: a reconstruction as a config describes it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "optim/loss_term.h"
#include "pipelines/run_config.h"
#include "pipelines/run_summary.h"

namespace hsi4d::cli {

struct RunArguments {
  std::filesystem::path config;
  std::vector<std::string> overrides;
  std::string out;  ///< empty: runs/NAME
  bool resume = false;
  int threads = 0;  ///< 0: what the config says
  std::optional<std::int64_t> seed;
  bool dry_run = false;
  bool print_config = false;
};

/// Carries out the run and returns what stdout gets: the table of errors and where the results are; the resolved config
/// with print_config, the plan with dry_run (then nothing is written).
std::string run_command(const RunArguments& arguments, const std::vector<LossTerm>& losses);

/// A run with progress on stderr that ends in good order on Ctrl-C.
RunSummary run_on_terminal(const RunConfig& config, const std::vector<LossTerm>& losses, const std::string& folder,
                           bool resume, int threads, bool quiet = false);

/// The table of errors, the time and where the report is.
std::string result_text(const RunSummary& summary, const std::string& folder);

}  // namespace hsi4d::cli
