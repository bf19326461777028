// `hsi4d bench pareto`: run time against error, setting by setting, and what an error comes to in a reconstruction.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "optim/loss_term.h"

namespace hsi4d::cli {

struct BenchParetoOptions {
  std::vector<std::string> scenes;       ///< by name; empty: all, or none where there are files
  std::vector<std::string> scene_files;  ///< files of Gaussians and folders of such files, a scene each
  std::vector<std::string> knobs;        ///< empty: all
  int threads = 1;
  int repeats = 9;
  std::filesystem::path config = "configs/bench/pareto_tracking.json";  ///< of the reconstructions
  std::vector<std::string> overrides;                                   ///< of the config
  int seeds = 5;                                    ///< of the reconstructions; 0: these are left out
  std::filesystem::path out = "runs/bench/pareto";  ///< folder of their datasets
  std::string json, csv, plot, front;               ///< files; empty: none
};

/// Measures, and reconstructs with the presets and with what is on the front of avatar_in_scene, but for what takes
/// more than four times as long as the default. Names and the config are looked at before anything is measured. Returns
/// tables.
std::string bench_pareto_command(const BenchParetoOptions& options, const std::vector<LossTerm>& losses);

}  // namespace hsi4d::cli
