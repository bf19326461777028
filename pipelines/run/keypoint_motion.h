// Poses of the human from keypoints, before anything is drawn: what sources.motion "embedded" stands for.
#pragma once

#include <vector>

#include "core/observer.h"
#include "optim/loss_term.h"
#include "pipelines/sources/sources.h"

namespace hsi4d {

/// A run's config changed to one that finds the human's poses by data.keypoints alone: the stage "pose" of
/// configs/from_video.json and, where a stage of the run finds frame 0 (finds_first_frame), "fit_first_pose". Camera
/// and objects are those of frame 0 in all frames. Images have at most 512 pixels a side, for which the stages' weights
/// are. Bones count where the keypoints have landmarks.
RunConfig keypoint_motion_config(const RunConfig& run, const std::vector<LossDescription>& losses);

/// Makes motions by such runs. Its errors are those of execute_run.
MotionMaker motion_maker(const std::vector<LossTerm>& losses, const Observer& observer);

}  // namespace hsi4d
