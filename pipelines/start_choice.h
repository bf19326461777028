// Which of several starts of a frame is the best.
#pragma once

#include "pipelines/clip.h"
#include "pipelines/color_state.h"
#include "pipelines/run_config.h"
#include "pipelines/state.h"

namespace hsi4d {

/// Whether a part of the state begins with the best of its starts (StartFrom::kBest).
bool chooses_start(const StartSettings& settings);

/// The start of a frame: each part for which the settings ask for the best begins where the frame before ended, going
/// on as before, or as estimated, whichever gives the image that is nearest to the frame's (mean absolute difference;
/// of equals the first). Root and joints are chosen together, then the objects. What does not ask for it stays as in
/// `state`.
/// @param done   the states of the frames before, frame 0 included
/// @param state  where frame_start begins, with the camera that the images are drawn from
SceneState choose_start(const RunConfig& config, const Clip& clip, const std::vector<SceneState>& done,
                        const ClipFrame& frame, const SceneState& state, const ColorState& colors);

}  // namespace hsi4d
