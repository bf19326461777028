// What `hsi4d evaluate` prints: numbers in columns that are folded to a terminal's width, and the paper's beside them.
#pragma once

#include <string>
#include <vector>

#include "pipelines/cli/evaluate_sweeps.h"

namespace hsi4d::cli {

/// A metric over the inputs that have it.
struct Spread {
  const MetricFacts* facts;
  double mean = 0, deviation = 0;  ///< the sample's standard deviation
  std::size_t count = 0;
};

/// A column a result; where they are repetitions of one config their mean, standard deviation and diversity too.
std::string table_of(const std::vector<Evaluation>& results, const std::vector<Spread>& spreads, bool has_mean,
                     const std::vector<Diversity>& diversity);

/// A row a result: what many runs of a sweep are shown as.
std::string table_of_runs(const std::vector<Evaluation>& results, const std::vector<Spread>& spreads);

/// What was taken for truth, scene and world, a line each.
std::string frames_text(const std::vector<Evaluation>& results);

/// The same of many runs: each sentence once, with how many it is of.
std::string notes_of_runs(const std::vector<Evaluation>& results, const EvaluateInputs& inputs);

/// The paper's figures that some result has a metric for, beside those of results and of rows of sweeps.
std::string published_text(const std::vector<Evaluation>& results, const EvaluateInputs& inputs);

}  // namespace hsi4d::cli
