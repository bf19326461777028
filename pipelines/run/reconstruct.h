// The reconstruction of a clip: frame by frame, stage by stage, with a checkpoint after every frame.
#pragma once

#include <string>
#include <vector>

#include "core/observer.h"
#include "optim/loss_term.h"
#include "pipelines/config/run_config.h"
#include "pipelines/input/clip.h"
#include "pipelines/record/folder.h"
#include "pipelines/record/summary.h"

namespace hsi4d {

/// How many frames a run in `folder` has finished, the given frame 0 not counted, according to its checkpoint; 0
/// without one. Errors as reconstruct, for a checkpoint that cannot be gone on with.
Index finished_frames(const std::string& folder, const RunConfig& config, const Clip& clip,
                      const std::vector<LossTerm>& losses);

/// Runs the stages of `config` on its clip and fills the run folder: metrics.jsonl, frames/, motion.npz, objects.npz,
/// cameras.json, summary.json, checkpoint/. Results do not depend on the number of threads, nor on having been
/// interrupted: a run that is resumed gives the same bits.
///
/// @param clip  what read_clip gave for config.data; what stages over the first frame find of it is put into it
/// Throws UserError and DataError for its inputs, Interrupted when asked to stop: what was done up to the last whole
/// frame is then in the checkpoint.
/// @return  what summary.json holds
RunSummary reconstruct(const RunConfig& config, Clip& clip, const std::vector<LossTerm>& losses, RunFolder& folder,
                       const Observer& observer);

}  // namespace hsi4d
