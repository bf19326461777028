// What a run came to, as summary.json holds it, and what is known of each metric: unit, direction, digits.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/types.h"
#include "pipelines/metrics/metric_facts.h"
#include "pipelines/metrics/quality.h"

namespace hsi4d {

/// What of a group's gradient came from a term (optim/gradient_shares.h): means over the evaluations that were looked
/// at.
struct MeanGradientShare {
  std::string group, term;
  double share = 0, cosine = 0;
  Index evaluations = 0;
};

/// One stage: its errors at its end, and counters.
struct StageSummary {
  std::string stage;
  double seconds = 0;
  Index iterations = 0;
  MetricValues values;
  std::vector<MeanGradientShare> gradient_shares = {};  ///< empty: not measured
  bool of_frame_0 = false;  ///< a stage over the first frame: the errors are those of frame 0 alone
};

/// A result without the method, to compare with: "start" (what the run was given), "copy_frame_0" (nothing moves), and
/// of a run with stages over the first frame "given_frame_0" (frame 0 as it was given).
struct Baseline {
  std::string name;
  MetricValues values;                  ///< means over the frames
  std::vector<FrameMetrics> per_frame;  ///< may be empty
  bool of_frame_0 = false;              ///< the errors are those of frame 0 alone
};

/// A person beside the first one (data.people): errors, contact and jitter, means over the frames.
struct PersonSummary {
  std::string name;
  MetricValues start;  ///< of what the run was given
  MetricValues result;
  std::vector<FrameMetrics> per_frame = {};  ///< errors of the result; may be empty
};

/// How often a part of the state began a frame with which of its starts, where the best of them is taken.
struct StartCounts {
  std::string part;                                  ///< "pose", "root" or "objects"
  std::vector<std::pair<std::string, Index>> begun;  ///< frames by start: "previous", "estimate", "velocity"
};

/// What choosing the best starts came to.
struct StartSummary {
  double seconds = 0;
  std::vector<StartCounts> parts;  ///< empty: nothing was chosen
};

/// summary.json. Means are over the frames that were optimised, 1 to T; frame 0 is given.
struct RunSummary {
  std::string name;
  int frames = 0;
  double seconds = 0;
  bool has_truth = true;              ///< false: errors of body, objects and camera could not be measured
  bool is_on_plate = false;           ///< the scene is a background plate (pipelines/draw/plate_mark.h)
  std::string surface;                ///< the mesh by which penetration was measured; empty: it was not
  std::vector<StageSummary> metrics;  ///< in order, the last one is the final one
  StartSummary start;
  MetricValues found;  ///< of the clip, by stages over the first frame: "focal_length_px", "object_scale_vase", …
  std::vector<Baseline> baselines;
  std::vector<PersonSummary> people;    ///< beside the first one, whose errors are those of `metrics`
  std::vector<FrameMetrics> per_frame;  ///< of the result
  std::vector<FrameMetrics> first_pass =
      {};                            ///< likewise, of what the first pass left; empty: none followed, or no truth
  std::vector<QualityGate> quality;  ///< of the result; may be empty
};

/// The text of summary.json:
///
///   {"name", "frames", "seconds", "truth": BOOL, "plate": true, "surface",
///    "metrics": [{"stage", "frame"?, "seconds", "iterations", NAME: NUMBER...,
///                 "gradient_shares": {GROUP: {TERM: {"share", "cosine", "evaluations"}...}...}}...],
///    "start": {"seconds", PART: {START: FRAMES...}...}, "found": {NAME: NUMBER...},
///    "quality": {NAME: {"value", "word", "pass", "check"}...},
///    "people": {NAME: {"start": {NAME: NUMBER...}, "result": {NAME: NUMBER...}, "per_frame": as below}...},
///    "baselines": {NAME: {"frame"?, NAME: NUMBER...}}, "per_frame": [{"frame", NAME: NUMBER...}...],
///    "first_pass_per_frame": likewise, "baselines_per_frame": {NAME: [{"frame", NAME: NUMBER...}...]}}
///                                                                          (the last two, "plate", "surface", "start",
///    "found", "quality", "people" and "gradient_shares" only where there are any)
///
/// with "frame": 0 where errors are those of frame 0 alone.
/// Throws InternalError naming the member (a JSON pointer) for a number that is not finite, which JSON cannot hold, and
/// for a name that occurs twice.
std::string summary_json(const RunSummary& summary);

/// Reads what summary_json writes. Members that it does not know are passed over, as newer versions may add some.
///
/// @param name  what messages call the text: the file
/// Throws DataError naming file, line and member.
RunSummary parse_summary(const std::string& text, const std::string& name);

/// The errors that occur in some result: a row a metric, as results are few and terminals narrow; a column a result,
/// baselines first, then stages. The best of a row is marked; errors of frame 0 alone are compared with each other.
Table error_table(const RunSummary& summary);

/// The same of the people beside the first one, two columns each: what they began with, and the result. Empty where
/// there are none.
Table people_table(const RunSummary& summary);

/// The tables of errors for a terminal, or that there are none.
std::string error_text(const RunSummary& summary);

}  // namespace hsi4d
