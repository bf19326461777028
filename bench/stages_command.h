// `hsi4d bench stages`: a run whose operators are timed.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "optim/loss_term.h"

namespace hsi4d::cli {

struct BenchStagesOptions {
  std::filesystem::path config = "configs/bench/paper_scale.json";  ///< names its data, or has a section `synthetic`
  std::vector<std::string> overrides;
  std::string out;       ///< folder of dataset and run; empty: runs/bench/NAME
  int threads = 0;       ///< 0: what the config says
  std::string json;      ///< file for the measurements; empty: none
  std::string plot;      ///< file for the SVG; empty: none
  bool compare = false;  ///< run again without skips, and tell the ratio
};

/// Iterations of a stage in the run without skips, at most.
inline constexpr int kIterationsWithoutSkips = 20;

/// Carries out a run of the config into the first free OUT/run, OUT/run-2, …; of a generated dataset, which is made in
/// OUT/dataset unless it is there, where the config names no data; with `compare` then one without skips. Returns the
/// tables.
std::string bench_stages_command(const BenchStagesOptions& options, const std::vector<LossTerm>& losses);

}  // namespace hsi4d::cli
