// `hsi4d gradcheck CONFIG --stage S`: whether a stage's gradient is right.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "optim/loss_term.h"
#include "pipelines/run/stage_check.h"

namespace hsi4d::cli {

struct GradcheckArguments {
  std::filesystem::path config;
  std::vector<std::string> overrides;
  StageCheckOptions check;
  std::optional<int> threads;
  std::string json;  ///< path to write one JSON object a parameter group to; empty: none
};

/// Returns a row for each parameter group of the stage, and what is wrong.
/// @param status  set where a gradient is wrong, or cannot be judged
std::string gradcheck_command(const GradcheckArguments& arguments, const std::vector<LossTerm>& losses, int& status);

}  // namespace hsi4d::cli
