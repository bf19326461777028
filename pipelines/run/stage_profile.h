// Where the time and the memory of a stage go, for who measures: nothing is measured unless somebody asks.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "optim/stage.h"
#include "splat/render/render_counters.h"

namespace hsi4d {

/// All nodes of a tape that run the same operator.
struct OperatorProfile {
  std::string name;
  Index nodes = 0;
  Index forward_runs = 0, forward_skips = 0, backward_runs = 0;
  double forward_seconds = 0, backward_seconds = 0;
};

/// One stage, in a frame or over the sequence.
struct StageProfile {
  std::string stage;
  std::optional<Index> frame = {};  ///< none: all at once
  Index iterations = 0;
  double seconds = 0;            ///< from before the tape was recorded until the state was read back
  double iteration_seconds = 0;  ///< of the iterations, without what is made of their reports
  double first_seconds = 0;      ///< of the first of them, in which memory is met for the first time
  StageTimes times = {};         ///< of the iterations
  std::vector<OperatorProfile> operators = {};
  Index nodes = 0;               ///< of the tape
  RenderCounters counters = {};  ///< sums over the iterations; none over the sequence
  TapeCounters tape = {};        ///< sums over the iterations
  Index pixels_of_image = 0;     ///< 0: nothing was drawn
  Index tiles_of_image = 0;      ///< likewise
  std::int64_t allocations = 0;  ///< by iterations in the second half of those that the stage may have
  Index counted = 0;             ///< how many these are; 0: allocations are not counted, or it ended before
  Index tape_bytes = 0;
  std::optional<CurvatureCost> curvature = {};  ///< of one more evaluation
};

/// Who wants to know.
struct StageWatch {
  std::function<void(const StageProfile&)> done;
  std::function<std::int64_t()> allocation_count;  ///< heap allocations of the process so far; empty: not counted
  bool curvature = false;  ///< also time one curvature a stage; its seconds and memory are the run's too
};

/// Measures one stage: made before its tape is recorded, asked around each iteration, ended after it. Does nothing
/// where `watch` is null.
class StageProbe {
 public:
  explicit StageProbe(const StageWatch* watch);

  bool is_on() const { return watch_ != nullptr; }
  bool times_curvature() const { return watch_ != nullptr && watch_->curvature; }
  /// An iteration is over, nothing has been made of its report yet.
  /// @param counters  null: nothing was drawn
  void iteration_ended(const IterationReport& report, const RenderCounters* counters);
  /// All has been made of it.
  void iteration_begins();
  /// The stage is over.
  /// @param profile  names the stage, its frame, the tiles of an image, and the tape's memory
  void stage_ended(const StageResult& result, StageProfile profile) const;

 private:
  std::int64_t allocation_count() const;

  const StageWatch* watch_;
  std::chrono::steady_clock::time_point start_;
  RenderCounters counters_;
  TapeCounters tape_;
  double iteration_seconds_ = 0, first_seconds_ = 0;
  std::int64_t allocations_ = 0, before_ = 0;
  Index counted_ = 0;
};

}  // namespace hsi4d
