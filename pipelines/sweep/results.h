// What a sweep has come to so far: its runs, means over seeds, differences to what they are compared with.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "pipelines/record/summary.h"
#include "pipelines/sweep/folder.h"
#include "pipelines/sweep/statistics.h"

namespace hsi4d {

/// A run as it stands.
struct SweepRow {
  std::size_t index = 0;
  SweepRunState state = SweepRunState::kNew;
  MetricValues values;  ///< of its last stage, and `seconds` of the run; empty unless it is done
  std::size_t starts = 0;
  std::size_t programs = 0;                ///< builds of hsi4d that have computed at it
  std::optional<SweepAttempt> last;        ///< what was noted last
  double peak_mb = 0;                      ///< the most of all attempts; 0: not known
  std::vector<std::string> warnings = {};  ///< of its log, each once
};

/// Runs that differ in clip and seed alone.
struct SweepGroup {
  std::string label;
  std::vector<std::size_t> rows;  ///< each run once, also where several combinations come to it
  bool is_reference = false;      ///< others are compared with it
};

/// Differences of a metric, each between two runs of the same clip and seed.
struct PairedDifference {
  SampleStatistics statistics;
  std::vector<double> differences;
  std::optional<Interval> interval;  ///< of the mean, 95 %
};

struct SweepResults {
  SweepPlan plan;
  std::vector<SweepRow> rows;  ///< by index
  std::vector<SweepGroup> groups;
  std::vector<std::string> clips;           ///< in order; one that is "" where there are none
  std::vector<const MetricFacts*> metrics;  ///< those that some run has
  std::size_t count(SweepRunState state) const;
};

/// Facts of the share of quality gates that a run passes, and of its time, which are metrics here.
const MetricFacts& gates_facts();
const MetricFacts& seconds_facts();

/// Results of runs as they stand: their groups, clips and metrics. @param rows  by index, of all runs of the plan
SweepResults sweep_results_of(SweepPlan plan, std::vector<SweepRow> rows);

/// Reads how the runs of a folder stand. Errors as read_sweep_plan.
SweepResults read_sweep_results(const SweepPaths& paths);

/// A metric of a group.
struct GroupStatistics {
  SampleStatistics sample;                                      ///< over the seeds
  std::vector<std::pair<std::string, std::string>> clip_seeds;  ///< the runs that count, sorted
};

/// A metric of a group over its seeds: of each seed the mean over the clips, of those seeds of which all the group's
/// clips have it.
/// @param clip  the runs of this clip alone; null: all
GroupStatistics group_statistics(const SweepResults& results, const SweepGroup& group, const MetricFacts& metric,
                                 const std::string* clip = nullptr);

/// A metric of a group less that of what it is compared with, run by run; nothing where there is no pair.
std::optional<PairedDifference> paired_difference(const SweepResults& results, const SweepGroup& group,
                                                  const MetricFacts& metric);

/// The index of the run that a run is compared with: same clip and seed, the values of `compare`, and of all else what
/// the run has too; of its own block rather than of another one. Nothing for one that others are compared with.
std::optional<std::size_t> partner_of(const SweepPlan& plan, std::size_t index);

}  // namespace hsi4d
