// What a chain of clips came to: errors over all of them, of each, and at the joins.
#pragma once

#include <string>
#include <vector>

#include "pipelines/record/summary.h"

namespace hsi4d {

/// A clip of a chain that is done.
struct ClipSummary {
  std::string name;
  int begin = 0;  ///< the frame of the chain that its frame 0 is
  RunSummary summary;
};

/// Where a clip goes on from another.
struct JoinSummary {
  std::string before, after;  ///< the clips
  int frame = 0;              ///< of the chain
  /// jump_mm, jump_object_cm, jump_object_deg: between the last state of the one and the first of the other, 0 unless
  /// a stage over the first frame moved it. With truth the errors of that first state, body and objects: the drift.
  MetricValues values;
};

/// summary.json of a chain.
struct ChainSummary {
  RunSummary all;  ///< means over frames 1 to T of all clips, sums of work
  std::vector<ClipSummary> clips;
  std::vector<JoinSummary> joins;
};

/// The clips' errors and work as those of one run. Means are weighted by the frames that have the metric where errors
/// by frame are there (the result and baselines), else by the clips' frames.
RunSummary joined_summary(const std::string& name, const std::vector<ClipSummary>& clips);

/// The text of summary.json: as summary_json, and
///
///   "clips": [{"name", "begin", "frames", "seconds", NAME: NUMBER...}...],    of the clip's last stage
///   "joins": [{"before", "after", "frame", NAME: NUMBER...}...]
std::string chain_summary_json(const ChainSummary& summary);

/// Reads what chain_summary_json writes; of a clip's summary its frames, seconds and last stage.
/// Throws DataError naming file, line and member.
ChainSummary parse_chain_summary(const std::string& text, const std::string& name);

/// Errors of the clips, and at the joins: a row a metric, a column a clip or join. Without rows where there are none.
Table clip_table(const ChainSummary& summary);
Table join_table(const ChainSummary& summary);

/// What is known of the jumps of JoinSummary, which are no errors of a run.
const std::vector<MetricFacts>& join_metric_facts();

}  // namespace hsi4d
