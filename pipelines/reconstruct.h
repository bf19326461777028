// The reconstruction of a clip: frame by frame, stage by stage, with a checkpoint after every frame.
#pragma once

#include <string>
#include <vector>

#include "optim/loss_term.h"
#include "pipelines/clip.h"
#include "pipelines/observer.h"
#include "pipelines/run_config.h"
#include "pipelines/run_folder.h"
#include "pipelines/run_summary.h"

namespace hsi4d {

/// Checks the stages beyond what reading the config does: the groups of parameters exist for what a stage draws and
/// move at some time, and there is a loss. Throws one UserError with every problem.
void check_stages(const RunConfig& config);

/// check_stages, and that there is a stage and every input is named. Throws one UserError with every problem.
void check_run(const RunConfig& config);

/// Runs the stages of `config` on its clip and fills the run folder: metrics.jsonl, frames/, motion.npz, objects.npz,
/// cameras.json, summary.json, checkpoint/. Results do not depend on the number of threads, nor on having been
/// interrupted: a run that is resumed gives the same bits.
///
/// @param clip  what read_clip gave for config.data
/// Throws UserError and DataError for its inputs, Interrupted when asked to stop: what was done up to the last whole
/// frame is then in the checkpoint.
/// @return  what summary.json holds
RunSummary reconstruct(const RunConfig& config, const Clip& clip, const std::vector<LossTerm>& losses,
                       RunFolder& folder, const Observer& observer);

}  // namespace hsi4d
