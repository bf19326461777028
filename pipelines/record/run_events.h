// What TensorBoard shows of a run: losses, images and metrics as events (pipelines/record/event_file.h) beside
// metrics.jsonl.
//
//   loss/STAGE, loss_STAGE/TERM    by line of metrics.jsonl, from 0; terms without their weights
//   frame_loss/STAGE               by frame: the last loss of a stage
//   images/KIND                    by frame: target, render, difference, the files of frames/ as they are
//   result/METRIC                  by frame: per_frame of summary.json
//   mean/METRIC                    once: the last stage of summary.json
//
// A line that holds null, of a step that was not taken, is left out. An event's time is that at which the run was
// started, and the seconds of the iterations since.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/types.h"
#include "pipelines/record/appended_file.h"
#include "pipelines/record/event_file.h"
#include "pipelines/record/folder.h"
#include "pipelines/record/summary.h"

namespace hsi4d {

/// Which images of frames are shown.
struct ShownImages {
  int every = 0;                 ///< those of each frame whose number is a multiple of this; 0: none
  bool are_drawn_again = false;  ///< all but those of frame 0, when all frames are done: these are shown, not the first
};

/// The events of a run while it goes on. Used by one thread at a time.
class RunEvents {
 public:
  /// Begins a file anew with what metrics.jsonl and frames/ hold of the frames from `first` up to `end`, which are
  /// done, and of all that came after the first pass through the frames, and removes the file of before: a run that is
  /// resumed has the events of one that never was stopped. Throws UserError where it cannot be written, DataError for a
  /// line or a time that is none of ours.
  RunEvents(const RunFolder& folder, ShownImages images, Index first, Index end);
  ~RunEvents();
  RunEvents(const RunEvents&) = delete;
  RunEvents& operator=(const RunEvents&) = delete;

  /// A line of metrics.jsonl.
  void add(const IterationRecord& record);

  /// A frame is done, or done again in a later pass, and its images are in frames/.
  void end_frame(Index frame);

  /// The images of a frame are in frames/, as they stay: at the end of a run that draws them again.
  void add_images(Index frame);

  /// The run is done.
  void add_result(const RunSummary& summary);

 private:
  void add_kept_lines(Index first, Index end);
  EventTime at(std::int64_t step) const;

  RunPaths paths_;
  ShownImages images_;
  double started_;  // seconds since 1970
  double seconds_ = 0;
  std::int64_t lines_ = 0;
  std::vector<std::pair<std::string, double>> frame_losses_;  // of the frame at hand
  std::unique_ptr<AppendedFile> file_;
};

/// Removes the events of a run that goes on without them.
void remove_run_events(const RunPaths& paths);

}  // namespace hsi4d
