// The reconstruction of a clip: frame by frame, stage by stage, with a checkpoint after every frame.
#pragma once

#include <functional>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/progress.h"
#include "optim/loss_term.h"
#include "pipelines/clip.h"
#include "pipelines/run_config.h"
#include "pipelines/run_folder.h"
#include "pipelines/run_summary.h"

namespace hsi4d {

/// Somebody asked for the run to stop. What was done up to the last whole frame is in the checkpoint.
class Interrupted : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Who watches a run.
struct RunObserver {
  ProgressSink progress;                 ///< empty: nobody
  double progress_interval = 0.1;        ///< seconds
  std::function<bool()> stop_requested;  ///< asked after every iteration; empty: never
};

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
/// Throws UserError and DataError for its inputs, Interrupted when asked to stop.
/// @return  what summary.json holds
RunSummary reconstruct(const RunConfig& config, const Clip& clip, const std::vector<LossTerm>& losses,
                       RunFolder& folder, const RunObserver& observer);

}  // namespace hsi4d
