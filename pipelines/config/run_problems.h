// What is wrong with a config as a whole, each setting being right in itself.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "core/config_value.h"
#include "pipelines/config/run_config.h"

namespace hsi4d {

/// Whether a loss of the stage weighs by how sure places are.
bool weighs_by_sigma(const StageSettings& stage);

/// The stages whose ends tell how sure places are: of each pass the last that moves what moves and compares pixels.
std::vector<std::size_t> stages_of_sigmas(const RunConfig& config);

/// A problem and the place of the setting that it is about.
struct RunProblem {
  std::string pointer;  ///< JSON pointer
  std::string text;
  std::vector<std::string> needs;  ///< pointers; a problem at or below one of them leaves open whether this is one
  bool is_absence = false;         ///< a key is not written; an unknown key beside it may be meant
};

/// What no run could do: stages without loss or parameters, with parameters or losses of what they do not draw,
/// parameters that never move, every loss at weight 0; objects that are named as the human's masks are. For a run also
/// what it lacks: stages, inputs.
std::vector<RunProblem> run_problems(const RunConfig& config, ConfigUse use);

/// Adds them with the places where the settings were written in `tree`, and those of losses that cannot be prepared;
/// the others are prepared. Problems that may only follow from some that were found before are left out.
void add_run_problems(const ConfigValue& tree, RunConfig& config, ConfigUse use, ConfigProblems& problems);

/// Prepares the losses of a run. Throws one UserError with every problem of it, a line each.
void prepare_run(RunConfig& config);

/// Throws one UserError with every problem of a run's inputs, a line each.
void check_inputs(const DataSettings& data);

}  // namespace hsi4d
