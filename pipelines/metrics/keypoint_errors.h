// How far the body is in the image from where a detector found it, which needs no truth.
#pragma once

#include <vector>

#include "pipelines/input/clip.h"
#include "pipelines/metrics/metric_facts.h"

namespace hsi4d {

/// Confidence from which a point counts as found.
inline constexpr double kFoundConfidence = 0.5;

/// `keypoints_px` by frame: the mean distance of the points that were found from where the state's camera sees them,
/// pixels of the clip's image. Nothing of a frame in which none was found, or one is not before the camera; nothing at
/// all of a clip without keypoints.
/// @param states  of frames 0, 1, ... of the clip
std::vector<MetricValues> keypoint_errors_by_frame(const Clip& clip, const std::vector<SceneState>& states);

}  // namespace hsi4d
