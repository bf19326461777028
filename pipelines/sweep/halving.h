// Successive halving of a search, and its budget of hours: which runs are started, from what the folder holds alone, so
// that it comes to the same whoever asks, and when.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "pipelines/metrics/metric_facts.h"
#include "pipelines/sweep/folder.h"

namespace hsi4d {

/// Whether a run is to be computed: now, not before the rung below is complete, or not at all, as its point has not
/// come so far.
enum class SweepTurn { kNow, kLater, kNever };

/// Which points of a rung go on to the next: the best `count` of them, of equal ones the first. Those without a score
/// come last.
/// @param better  as in MetricFacts
/// @return  indices, in order
std::vector<std::size_t> best_points(const std::vector<std::optional<double>>& scores, int better, std::size_t count);

/// The metrics of a run of the plan that is done; nothing of others.
using DoneMetrics = std::function<std::optional<MetricValues>(std::size_t)>;

/// The turns of a plan's runs. A point's score in a rung is the median of the search's metric over its runs, which have
/// the clips and seeds of all other points; one with a run that has failed has none. Of N points the best N / factor go
/// on, one at least. Points compete with those that have the same values on all other axes.
class SweepTurns {
 public:
  /// @param plan  must outlive this
  SweepTurns(const SweepPlan& plan, DoneMetrics metrics);

  /// @param may_end  whether a run that is not done may still come to that: what has failed may not. Points that go on
  /// are settled once no run of the rung below may
  SweepTurn turn(std::size_t run, const std::function<bool(std::size_t)>& may_end);

 private:
  struct Rung {
    std::vector<std::pair<std::string, std::vector<std::size_t>>> points;  ///< and their runs
    std::optional<std::set<std::string>> computed;                         ///< the points that are, once it is settled
  };
  struct Place {
    std::string bracket, point;
  };

  const std::set<std::string>* computed_points(const std::string& bracket, std::size_t rung,
                                               const std::function<bool(std::size_t)>& may_end);
  std::optional<double> score(const std::vector<std::size_t>& runs, const std::string& metric) const;

  const SweepPlan& plan_;
  DoneMetrics metrics_;
  std::vector<Place> places_;  // by run
  std::map<std::string, std::vector<Rung>> brackets_;
};

/// The metrics of runs that a folder holds.
DoneMetrics done_metrics(const SweepPaths& paths, const SweepPlan& plan);

/// How the runs of a plan stand, by index; new ones that halving leaves out as such.
std::vector<SweepRunState> sweep_run_states(const SweepPaths& paths, const SweepPlan& plan);

/// How many of the plan's different runs halving leaves out in the end.
std::size_t left_out_by_halving(const SweepPlan& plan);

/// What attempts at the plan's runs have taken so far, added up, of those that have ended.
double spent_hours(const SweepPaths& paths, const SweepPlan& plan);

/// True once the plan's hours are over: no run is started any more.
bool is_over_budget(const SweepPaths& paths, const SweepPlan& plan);

}  // namespace hsi4d
