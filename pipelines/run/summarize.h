// What a run came to: the errors of each of its stages, and of what it was given.
#pragma once

#include <string>

#include "pipelines/config/run_config.h"
#include "pipelines/input/clip.h"
#include "pipelines/metrics/sequence_errors.h"
#include "pipelines/record/summary.h"
#include "pipelines/run/checkpoint.h"

namespace hsi4d {

/// Where a state puts everything, for the metrics. A stage that draws the scene alone is judged by its camera alone.
FrameState placed(const Avatar& avatar, const SceneState& state, Draw draw = Draw::kAll);

/// The summary of a run that is at its end. Errors of poses are there where the clip has truth; those of images always
/// are, at the last stage and at the last of the first pass; penetration where the clip has a surface.
/// @param progress  all frames and all stages are done
RunSummary summarize_run(const RunConfig& config, const Clip& clip, const RunProgress& progress);

/// Adds what the stages that measure them found of shares of the gradient: from the lines of metrics.jsonl, which a run
/// that was resumed has whole.
void add_gradient_shares(const RunConfig& config, const std::string& metrics_file, RunSummary& summary);

}  // namespace hsi4d
