// `hsi4d bench stages`: where the time of a whole run goes.
#pragma once

#include <string>
#include <vector>

#include "pipelines/run/stage_profile.h"

namespace hsi4d {

/// One stage in all frames, or over the sequence.
struct StageCost {
  std::string stage;
  Index frames = 0;                       ///< in which it ran; 0: over the sequence
  StageProfile sum;                       ///< counts and seconds of all of them; of tape_bytes and nodes the most
  std::vector<double> ms_an_iteration;    ///< by frame
  std::vector<CurvatureCost> curvatures;  ///< of one evaluation a frame

  double ms_each() const;                      ///< an iteration, on average
  double ms_each_of(double iterations) const;  ///< the same, had each frame as many: the first is another than the rest
  double median_ms() const;                    ///< of the frames' averages
  double min_ms() const;                       ///< the least of them
  double evaluation_ms() const;                ///< forward and backward, on average
};

/// What a run took.
struct RunCost {
  std::vector<StageCost> stages;  ///< in the order in which they were first met
  int threads = 1;
  double seconds = 0;           ///< of the run, reading and writing included
  Index peak_memory_bytes = 0;  ///< of the process
};

/// Adds one stage of a frame.
void add_profile(const StageProfile& profile, std::vector<StageCost>& stages);

/// Seconds of the iterations of all stages.
double optimisation_seconds(const RunCost& cost);

/// A table: a line a stage with its counters, then a line an operator with its share, the largest first; what is not in
/// an operator (Adam, the tape itself) last.
std::string cost_table(const RunCost& cost);

/// The table as one JSON object a line: {"name", "stage", "iterations", ...}, then {"stage", "operator", ...}; of the
/// whole run last.
std::string cost_json(const RunCost& cost);

/// A bar a stage, as long as an iteration, parted by operators, as an SVG file.
std::string cost_svg(const RunCost& cost, const std::string& title);

}  // namespace hsi4d
