// How far the image of a state is from the video's frame.
#pragma once

#include "optim/metrics.h"
#include "pipelines/input/clip.h"
#include "pipelines/run/reconstruct_stage.h"

namespace hsi4d {

/// Errors of the image over all pixels and in the foreground, the background's beside masks and drawn people, and the
/// mean intersection over union of the people that masks show.
/// @param picture  of the state, with silhouettes
MetricValues picture_errors(const StatePicture& picture, const ClipFrame& frame);

}  // namespace hsi4d
