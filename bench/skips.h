// `hsi4d bench stages --compare`: what a run takes with skips and without.
#pragma once

#include <string>

#include "bench/stages.h"
#include "pipelines/config/run_config.h"

namespace hsi4d {

/// The config with every exact skip off, so slow that a few iterations of each stage must do: at most `iterations`.
/// Groups that would move later do so in the last one; without skips one iteration costs as much as another.
RunConfig without_skips(RunConfig config, int iterations);

/// Of a run with skips and one without them, a line a stage that draws and one of the whole run: milliseconds an
/// iteration, their ratio, and counters. The whole run without skips is that of as many iterations as the run with them
/// had, and of what that took beside them.
std::string comparison_table(const RunCost& with, const RunCost& without);

/// The same as one JSON object a line: {"name", "stage", "ms", "ms_without_skips", "ratio", counters}, then the whole
/// run's
/// {"seconds", "seconds_without_skips", "ratio"}.
std::string comparison_json(const RunCost& with, const RunCost& without);

}  // namespace hsi4d
