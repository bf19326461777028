// `hsi4d demo`: the method on a generated scene with ground truth.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "optim/loss_term.h"

namespace hsi4d::cli {

struct DemoArguments {
  bool quick = false;
  std::string out;  ///< empty: the first of runs/NAME, runs/NAME-2, … that is free
  std::vector<std::string> overrides;
  bool quiet = false;
  bool resume = false;
  std::optional<int> threads;  ///< 0: one a core; none: what the config says
};

/// Makes the dataset in OUT/dataset and reconstructs it into OUT/run. Returns the table of errors and where the report
/// is.
std::string demo_command(const DemoArguments& arguments, const std::vector<LossTerm>& losses);

}  // namespace hsi4d::cli
