// What the log says of the stages of a run.
#pragma once

#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "optim/stage.h"
#include "pipelines/config/run_config.h"
#include "pipelines/input/clip.h"
#include "pipelines/record/folder.h"
#include "pipelines/run/checkpoint.h"

namespace hsi4d {

/// A loss and its terms: "0.1234 (l1 0.1, ssim 0.2)".
std::string loss_text(double loss, std::span<const LossValue> terms);

/// What a stage did: iterations, time, loss before and after, steps not taken, what terms left out and noted.
/// @param begin  loss_text of the first iteration
std::string stage_text(const std::string& stage, const StageResult& result, const std::string& begin, const Clip& clip);

/// What metrics.jsonl keeps of an iteration. It refers to the report.
/// @param frame     none: all at once
/// @param counters  null: nothing was drawn
IterationRecord iteration_record(std::optional<Index> frame, const std::string& stage, const IterationReport& report,
                                 const RenderCounters* counters);

/// Every object that a term of a stage left out: one warning, with its frames.
void warn_of_left_out(const std::vector<LeftOutInFrame>& left_out, const RunConfig& config, const Clip& clip);

/// Every group that had no gradient in all of a stage: one warning, with its frames; of hands, jaw and eyes, which are
/// often hidden, as an information.
void warn_of_still_groups(const std::vector<StillGroup>& still, const RunConfig& config);

/// Every stage that turned something further than a setting of `approx` allows for: one warning, with its frames.
void warn_of_left_ranges(const std::vector<LeftRange>& left_ranges, const RunConfig& config);

/// Objects of which what is drawn hardly covers what the masks show: one warning each, with the frames.
/// @param ious  [frame][object]; none: the mask does not show it
void warn_of_lost(const std::vector<std::vector<std::optional<double>>>& ious, const Clip& clip);

/// Sees the iterations of a stage.
class GradientWatch {
 public:
  void see(std::span<const GroupStep> groups);
  /// Groups that were on in some iteration, and had a gradient other than 0 in none.
  std::vector<std::string> still_groups() const;

 private:
  std::map<std::string, bool, std::less<>> has_gradient_;  // by group that was on
};

/// Every term of a stage that moves nothing by what it found: one warning, with that.
/// @param of_clip  only those that move nothing in any frame
void warn_of_idle_terms(const std::vector<LossNote>& notes, const std::string& stage, bool of_clip);

/// A stage over the sequence that leaves the joints where they were: less than a tenth of a millimetre on average is a
/// warning, with how far. Its terms then hold each other, or nothing moves.
/// @param before, after  by frame, frame 0, which stands, included
void warn_of_still_joints(const Clip& clip, const std::vector<SceneState>& before, const std::vector<SceneState>& after,
                          const std::string& stage);

/// Every term of a stage that is off: one warning, with the reason. Where there are no objects, nothing of terms that
/// mean nothing then (is_of_objects).
void warn_of_terms_off(const std::vector<std::string>& off, const std::string& stage, const StageSettings& settings,
                       bool has_objects);

}  // namespace hsi4d
