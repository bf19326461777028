// What is wrong with the inputs that a config names, and with the programs that make them.
#pragma once

#include <vector>

#include "pipelines/config/run_problems.h"

namespace hsi4d {

/// Names that collide, inputs that exclude each other, commands with placeholders that mean nothing, clips of a chain
/// that do not fit together. For a run also what is missing.
void add_input_problems(const RunConfig& config, ConfigUse use, std::vector<RunProblem>& found);

/// Names that collide and what is missing, where nothing makes inputs.
void add_given_input_problems(const DataSettings& data, std::vector<RunProblem>& found);

}  // namespace hsi4d
