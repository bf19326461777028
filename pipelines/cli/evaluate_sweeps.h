// What `hsi4d evaluate` measures, runs of sweeps among it, and what these come to together.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/config_value.h"
#include "pipelines/evaluate/evaluation.h"
#include "pipelines/sweep/results.h"
#include "pipelines/sweep/selection.h"

namespace hsi4d::cli {

/// Runs of a sweep that are measured.
struct MeasuredSweep {
  SweepSelection selection;
  std::size_t first = 0;  ///< index of the first of them among all inputs; the others follow
};

/// Inputs by their paths, and what they are called.
struct EvaluateInputs {
  std::vector<std::string> paths, names;
  std::vector<MeasuredSweep> sweeps;
};

/// Puts the runs that a sweep's folder or SWEEP/NAME stands for in its place. They are called as results.csv has it,
/// with the sweep's folder before that where there is something else beside them. Throws as select_sweep_runs.
EvaluateInputs evaluate_inputs(const std::vector<std::string>& given);

/// How far repetitions are apart.
struct Diversity {
  const MetricFacts* facts;
  double value;
};

/// The mean distance over all pairs of repetitions, in the world and of poses alone; nothing for one, and where rates
/// or skeletons differ.
std::vector<Diversity> diversity_of(const std::vector<const Evaluation*>& results);

/// Runs of a sweep that stand in one row of its results.
struct MeasuredRow {
  std::string label;
  std::vector<const Evaluation*> results;
};

/// The rows of all sweeps, with what was measured of each.
std::vector<MeasuredRow> measured_rows(const EvaluateInputs& inputs, const std::vector<Evaluation>& results);

/// The tables of `hsi4d report` from what was measured here: means and standard deviations over seeds, differences to
/// what the sweep compares with, and the diversity of repetitions.
/// @param columns  of the terminal, which they are folded to; nothing: as Markdown
std::string sweeps_text(const EvaluateInputs& inputs, const std::vector<Evaluation>& results,
                        std::optional<int> columns);

/// The numbers of these tables: a list of sweeps.
ConfigValue sweeps_json(const EvaluateInputs& inputs, const std::vector<Evaluation>& results);

}  // namespace hsi4d::cli
