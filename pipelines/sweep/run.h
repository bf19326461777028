// One run of a sweep, in the sweep's folder: computed once, whoever asks for it and however often.
#pragma once

#include <string>

#include "core/observer.h"
#include "optim/loss_term.h"
#include "pipelines/record/summary.h"
#include "pipelines/sweep/folder.h"

namespace hsi4d {

/// What asking for a run came to.
struct SweepRunResult {
  RunSummary summary;
  bool was_done = false;  ///< before
};

/// Carries out a run, or goes on with it; takes what is there where it is done. A dataset that it needs is made, or
/// waited for where another process makes it. Every start and every end is noted in the run's attempts.
/// @param claim     the right to compute this run
/// @param threads   0: what the plan says, or one a core
/// @param observer  shown what is computed; `stop_requested` ends it with its state saved
/// Throws as execute_run, also what is wrong with the run's files.
SweepRunResult run_one(const SweepPaths& paths, const SweepPlan& plan, std::size_t index, SweepClaim& claim,
                       const std::vector<LossTerm>& losses, int threads, const Observer& observer);

}  // namespace hsi4d
