// What a run has found so far, and its checkpoint.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/image.h"
#include "pipelines/input/clip.h"
#include "pipelines/input/clip_unknowns.h"
#include "pipelines/input/color_state.h"
#include "pipelines/input/state.h"
#include "pipelines/record/summary.h"
#include "pipelines/run/depth_bias.h"
#include "pipelines/run/start_choice.h"

namespace hsi4d {

/// Work and time that a stage has taken over the frames so far.
struct StageTotals {
  Index iterations = 0;
  Index rollbacks = 0;
  double seconds = 0;
  Index tiles = 0, pairs = 0, fragments = 0;  ///< rendered, over all iterations
};

/// An object that a loss term left out, in some iterations at least.
struct LeftOutInFrame {
  std::size_t stage = 0;
  Index frame = 0, object = 0;
  std::string term, reason;
};

/// A group of parameters whose gradient was 0 in every iteration of a stage of a frame: nothing depended on it.
struct StillGroup {
  std::size_t stage = 0;
  Index frame = 0;
  std::string group;
};

/// A stage of a frame in which what a setting of `approx` takes for small was not: the view of a part turned further
/// (view_turn_deg) than the colours are held for, or than Gaussians are kept for that it may show.
struct LeftRange {
  std::size_t stage = 0;
  Index frame = 0;
  std::string setting;  ///< of `approx`
};

/// Frame 0 after a stage over the first frame.
struct FirstFrameState {
  SceneState state;
  StageTotals totals;
};

/// What a stage that comes after the first pass through the frames has found.
struct LaterStage {
  std::vector<SceneState> states;  ///< by frame, frame 0 included; over frames: of those that are done
  StageTotals totals;
};

/// Everything that the next frame depends on, or that the end of the run tells.
struct RunProgress {
  std::vector<FirstFrameState> first_frame;          ///< by stage over the first frame; none: frame 0 is as given
  std::vector<std::vector<SceneState>> after_stage;  ///< [stage of the first pass][frame]; frame 0 is given or found
  std::vector<StageTotals> totals;                   ///< by stage of the first pass
  std::vector<MetricValues> image_errors;            ///< [frame]; none of a frame 0 that is as given
  std::vector<MetricValues> start_errors;            ///< the same of what each frame's image was given
  std::string inputs;                                ///< what was read so far, in the form of input_hashes
  Image covered;                                     ///< [1,H,W] 1 where the human or an object has been so far
  std::vector<LeftOutInFrame> left_out;              ///< in the order in which it happened
  std::vector<StillGroup> still;                     ///< likewise
  std::vector<LeftRange> left_ranges;                ///< likewise
  StartTotals start;                                 ///< where the best start was chosen
  std::vector<PlaceSigmas> sigmas;                   ///< [frame]; none unless a run needs them
  ColorState colors;                                 ///< after the last frame done
  ClipUnknowns unknowns;                             ///< what stages over the first frame found of the clip
  std::vector<std::vector<double>> seen;  ///< [frame][object] the share that is; none unless start.objects is best
  std::optional<DepthBias> bias;          ///< taken from all that stages over frames found; none: not yet
  std::vector<LaterStage> later;          ///< those that have begun, in the order in which they run
  std::vector<std::vector<std::optional<double>>> object_ious;  ///< [frame][object] of images of the result; likewise
  std::vector<MetricValues> result_errors;  ///< [frame] of images after the last of them; in no checkpoint
  double seconds = 0;                       ///< of what is done
  std::string isa;  ///< isa_name of who wrote the checkpoint; empty: not read from one, or from an older one

  /// Frames done, frame 0 included, in the first pass.
  Index frames_done() const { return after_stage.empty() ? 0 : static_cast<Index>(after_stage.front().size()); }
};

/// The states by frame after the last stage so far.
const std::vector<SceneState>& result_of(const RunProgress& progress);

/// Nothing done but the given frame 0.
/// @param stages  how many there are over frames, in the first pass
/// @param nets  with which the run begins, if it has some
RunProgress first_progress(const Clip& clip, std::size_t stages, std::vector<ColorNet> nets = {});

/// Writes the checkpoint of a run, in one step, with the name of the instruction set of now.
/// @param config  the text to which the checkpoint belongs: the config, without what no result depends on
void save_progress(const std::string& file, const std::string& config, const RunProgress& progress);

/// Reads it back, bit for bit. Throws DataError naming the file when it is damaged, of another config, or of another
/// clip.
/// @param stages, nets  as of first_progress
/// @param first_stages  how many there are over the first frame
/// @param later         what those are over that come after the first pass through the frames
RunProgress load_progress(const std::string& file, const std::string& config, const Clip& clip, std::size_t stages,
                          std::vector<ColorNet> nets = {}, std::size_t first_stages = 0,
                          std::span<const StageScope> later = {});

}  // namespace hsi4d
