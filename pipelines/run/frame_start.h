// Where the stages of a frame begin.
#pragma once

#include <vector>

#include "pipelines/config/start_settings.h"
#include "pipelines/input/clip.h"
#include "pipelines/input/state.h"

namespace hsi4d {

/// Throws UserError naming the setting that asks for estimates which the clip does not have.
void check_start(const StartSettings& settings, const Clip& clip);

/// What a run is given for a frame before it does anything: the estimates where there are some, else frame 0.
SceneState given_start(const Clip& clip, Index frame);

/// The state that the frame after `done` begins with: of parts whose best start is asked for, where the frame before
/// ended.
/// @param done  the states of the frames before, frame 0 included
SceneState frame_start(const StartSettings& settings, const Clip& clip, const std::vector<SceneState>& done);

}  // namespace hsi4d
