// `hsi4d bench scaling`: the time of an iteration against the size of what is reconstructed.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "optim/loss_term.h"

namespace hsi4d::cli {

struct BenchScalingOptions {
  std::filesystem::path config = "configs/bench/paper_scale.json";  ///< with the section `synthetic`
  std::vector<std::string> overrides;
  std::vector<std::string> axes;  ///< "scene", "scene=1000,2000"; empty: all
  int threads = 0;                ///< of all axes but `threads`; 0: what the config says
  int repeats = 20;               ///< iterations of a stage that are measured, of all rounds
  std::string json;               ///< file for the measurements; empty: none
  std::string plot;               ///< file for the SVG; empty: none
};

/// Measures the points of every axis; a point that several axes share is measured once. Every point's config is read
/// before the first is measured. Returns a table.
std::string bench_scaling_command(const BenchScalingOptions& options, const std::vector<LossTerm>& losses);

}  // namespace hsi4d::cli
