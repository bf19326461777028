// What is wrong with a config as a whole, each setting being right in itself.
#pragma once

#include <string>
#include <vector>

#include "core/config_value.h"
#include "core/log.h"
#include "pipelines/run_config.h"

namespace hsi4d {

/// A problem and the place of the setting that it is about.
struct RunProblem {
  std::string pointer;  ///< JSON pointer
  std::string text;
  std::vector<std::string> needs;  ///< pointers; a problem at or below one of them leaves open whether this is one
  bool is_absence = false;         ///< a key is not written; an unknown key beside it may be meant
};

/// What no run could do: stages without loss or parameters, with parameters that are not in what they draw or never
/// move, with every loss at weight 0; objects that are named as the human's masks are. For a run also what it lacks:
/// stages, inputs.
std::vector<RunProblem> run_problems(const RunConfig& config, ConfigUse use);

/// Adds them with the places where the settings were written in `tree`. Those that may only follow from problems that
/// were found before are left out.
void add_run_problems(const ConfigValue& tree, const RunConfig& config, ConfigUse use, ConfigProblems& problems);

/// What is no mistake and yet is to be known of a config.
struct RunNote {
  LogLevel level;  ///< warning: a setting that does nothing
  std::string text;
};

/// Approximations that are on, settings of `skip` and `approx` that switch others off or do nothing.
std::vector<RunNote> run_notes(const RunConfig& config);

/// Throws one UserError with every problem of a run, a line each.
void check_run(const RunConfig& config);

/// As check_run for the inputs alone.
void check_inputs(const DataSettings& data);

}  // namespace hsi4d
