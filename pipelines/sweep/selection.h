// Runs of a sweep by what they are called, in place of the hashes that their folders are called by:
//
//   runs/smoke                          all of them
//   runs/smoke/garden, whole, seed 1    the run of that name, as tables and results.csv have it
//   runs/smoke/no_color_net             those of a row of the results, or that have these parts of a name
//   runs/smoke/ablation=whole,seed=1    those that have these values, as `only` of the sweep's file names them
#pragma once

#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "pipelines/sweep/folder.h"

namespace hsi4d {

/// Runs of a sweep, of which those count that are done.
struct SweepSelection {
  std::string text;  ///< as it was written
  SweepPaths paths;
  SweepPlan plan;
  std::vector<std::size_t> named;  ///< indices of all combinations that were named, done or not, in order
  std::vector<std::size_t> runs;   ///< those that are done, each run once, also where several combinations come to it
  std::size_t not_done = 0;        ///< runs of those that were named
  std::set<std::string> axes;      ///< that were named: "ablation", or a key; empty: the whole sweep was

  std::string name(std::size_t run) const { return sweep_label(plan.runs[run]); }
  std::filesystem::path folder(std::size_t run) const { return paths.run(plan.runs[run].id); }
};

/// The runs that a path names: a sweep's folder, or a name in one. Nothing for a path that is there and is no sweep,
/// and for one that leads into no sweep: the run folder itself, for one, `runs/smoke/runs/HASH`.
///
/// Throws UserError where the sweep has no run of that name, with what it has, or none of them is done.
std::optional<SweepSelection> select_sweep_runs(const std::string& path);

/// What a run is called beside others that differ in these axes: its name without them; "" where nothing is left.
std::string name_without_axes(const SweepRun& run, const std::set<std::string>& axes);

}  // namespace hsi4d
