// A sweep on this machine: a process a run, as many at once as threads and memory allow.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "core/progress.h"
#include "pipelines/sweep/folder.h"

namespace hsi4d {

/// How the runs of a sweep are started.
struct SweepLaunch {
  std::string program;     ///< hsi4d, whose run-one is started
  int jobs = 0;            ///< the most runs at once; 0: as many as there are threads for
  int threads = 1;         ///< of all runs together
  double memory_mb = 0;    ///< that all runs together may take; 0: no limit
  bool fail_fast = false;  ///< nothing is started after a failure, and what runs is interrupted
  std::function<void(const std::string&)> tell = {};  ///< a line about a run, as soon as there is something to say
  ProgressSink progress = {};                         ///< of the whole sweep, now and then
  std::function<bool()> stop_requested = {};
};

/// A run that did not end well.
struct SweepFailure {
  std::size_t index = 0;
  std::string message;
  bool is_our_bug = false;
};

/// What carrying out a sweep came to.
struct SweepOutcome {
  std::size_t done_before = 0, computed = 0, by_others = 0;  ///< runs
  std::vector<SweepFailure> failures;
  std::vector<std::size_t> not_done;  ///< with fail_fast: interrupted, or not started
  std::size_t left_out = 0;           ///< by halving
  std::size_t over_budget = 0;        ///< not started as the plan's hours were over
};

/// Threads of each run: what the plan says, or the share of a job.
int sweep_threads(const SweepPlan& plan, const SweepLaunch& launch);

/// Runs at once by jobs and threads.
int sweep_jobs(const SweepPlan& plan, const SweepLaunch& launch);

/// Computes all runs of a plan that are not done and whose turn comes, until its hours are over. A run that another
/// launcher computes is waited for. A run that was ended by a signal, or could not be started, gets the line of its
/// attempts that it could not write itself. Throws Interrupted after what was running has saved its state.
SweepOutcome run_sweep_locally(const SweepPaths& paths, const SweepPlan& plan, const SweepLaunch& launch);

}  // namespace hsi4d
