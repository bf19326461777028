// How far the body is in the image from where a detector found it, which needs no truth.
#pragma once

#include <vector>

#include "pipelines/input/clip.h"
#include "pipelines/metrics/metric_facts.h"

namespace hsi4d {

/// How near a point must be for `keypoints_pck`, of the box around them. [Andriluka et al. 2014, of the
/// head's size there]
inline constexpr double kPckShare = 0.05;

/// `keypoints_px` by frame: the mean distance of the points that were found from where the state's camera sees them,
/// pixels of the clip's image; and `keypoints_pck`, the share of them that are nearer than kPckShare of the longer side
/// of the box around all that were found, where that has one. Nothing of a frame in which none was found, or one is not
/// before the camera; nothing at all of a person without keypoints.
/// @param states  of frames 0, 1, ... of the clip; the body is that of `person`
std::vector<MetricValues> keypoint_errors_by_frame(const Clip& clip, const std::vector<SceneState>& states,
                                                   std::size_t person = 0);

}  // namespace hsi4d
