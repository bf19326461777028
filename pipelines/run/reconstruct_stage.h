// The stages of a run: one of them in a frame, or over the sequence. A stage is its tape, what it is compared with, and
// the parts of the state that it moves.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "core/image.h"
#include "optim/loss_term.h"
#include "optim/stage.h"
#include "optim/stage_gradcheck.h"
#include "pipelines/config/run_config.h"
#include "pipelines/draw/track_points.h"
#include "pipelines/input/clip.h"
#include "pipelines/input/clip_unknowns.h"
#include "pipelines/input/color_state.h"
#include "pipelines/input/state.h"
#include "pipelines/run/stage_profile.h"
#include "splat/render/render.h"

namespace hsi4d {

/// A stage of a run.
struct StageTask {
  const RunConfig& config;
  const Clip& clip;
  const std::vector<LossTerm>& losses;  ///< that the config may name
  std::size_t stage = 0;                ///< in config.stages
  const StageWatch* watch = nullptr;    ///< null: nobody wants to know where time goes
  TrackPoints* tracks = nullptr;        ///< what was found of them in the run so far; null: found anew
  ClipUnknowns* found = nullptr;        ///< where to put what a stage of a frame finds of the clip; null: nowhere
  const std::vector<PlaceSigmas>* known = nullptr;  ///< how sure places are, by frame; null: nobody asked
  PlaceSigmas* sigmas = nullptr;  ///< where to put how sure it is of places in the end; null: nobody asks
};

/// A frame that stages work on.
struct FrameTask {
  Index index = 0;
  const ClipFrame& frame;
  const Image& covered;              ///< [1,H,W] 1 where the human or an object has been so far, in this frame too
  std::span<const SceneState> done;  ///< the result of the frames before, frame 0 included; none in frame 0
  std::span<const SceneState> after = {};  ///< where the stages before left those that follow; none in the first pass
};

/// Frames before the one at hand, and after it in a later pass, that terms over the motion see: three differences need
/// as many.
inline constexpr std::ptrdiff_t kFramesBefore = 3;

/// Called after every iteration of a frame's stage, with the work of its render. May throw to end the stage.
using FrameStageCallback = std::function<void(const IterationReport&, const RenderCounters&)>;

/// Runs a stage of a frame.
/// @param state   from where it starts; what the stage moves is written back, the camera in the scene's units
/// @param colors  likewise
/// Throws what run_stage throws.
StageResult run_frame_stage(const StageTask& task, const FrameTask& frame, SceneState& state, ColorState& colors,
                            const FrameStageCallback& callback);

/// Runs a stage over the sequence.
/// @param states  by frame, frame 0 included, which is given; what the stage moves is written back
/// Throws what run_stage throws.
StageResult run_sequence_stage(const StageTask& task, std::vector<SceneState>& states, const StageCallback& callback);

/// Checks the gradient of a stage of a frame against differences, in double whatever the config's precision. All of the
/// scene is drawn, wherever the camera may get. Throws as check_stage_gradient.
StageGradcheck check_frame_stage(const StageTask& task, const FrameTask& frame, const SceneState& state,
                                 const ColorState& colors, const StageGradcheckOptions& options = {});

/// Likewise of a stage over the sequence.
StageGradcheck check_sequence_stage(const StageTask& task, const std::vector<SceneState>& states,
                                    const StageGradcheckOptions& options = {});

/// The color nets that a run begins with, by person; none where a person has none (check_run_clip: then nobody has).
std::vector<ColorNet> first_nets(const RunConfig& config, const Clip& clip);

/// A state as its own camera sees it.
struct StatePicture {
  Image image;                 ///< [3,H,W]
  Image silhouette;            ///< [1,H,W] the human's opacity
  std::vector<Image> objects;  ///< [1,H,W] that of each object, where the best start is asked of them
  std::vector<Image> others;   ///< [1,H,W] that of each person beside the first one
};
StatePicture picture_of_state(const RunConfig& config, const Clip& clip, const SceneState& state,
                              const ColorState& colors);

/// The image alone, which costs less.
Image render_state(const RunConfig& config, const Clip& clip, const SceneState& state, const ColorState& colors);

}  // namespace hsi4d
