// What is told of a config before it runs.
#pragma once

#include <string>
#include <vector>

#include "core/log.h"
#include "pipelines/config/run_config.h"

namespace hsi4d {

/// What is no mistake and yet is to be known of a config.
struct RunNote {
  LogLevel level;  ///< warning: a setting that does nothing
  std::string text;
};

/// Whether a loss is on and means nothing where there are no objects.
bool is_of_objects(const LossSettings& loss);

/// Losses of objects where there are none, stages over the sequence without a prior, approximations that are on,
/// settings of `skip` and `approx` that switch others off or do nothing, and of optimisers that are of another kind
/// than the stage's.
std::vector<RunNote> run_notes(const RunConfig& config);

}  // namespace hsi4d
