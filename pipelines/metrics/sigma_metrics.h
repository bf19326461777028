// How sure a frame says that its places are, and whether they are as near to the truth as that.
#pragma once

#include "pipelines/input/state.h"
#include "pipelines/metrics/sequence_errors.h"

namespace hsi4d {

/// Beyond this, metres, a sigma tells no more than that the place is not known: the curvature is that of small changes.
inline constexpr double kUnsure = 1;

/// `sigma_image_mm` and `sigma_depth_mm`, means over the joints that are surer than kUnsure; `object_sigma_image_cm`
/// and `object_sigma_depth_cm` of the objects likewise; `unsure_share`, of joints and objects together, where some are
/// not. With a truth, of the same joints and objects: `within_sigma_image`, `within_sigma_depth`, the share of errors
/// that are at most sigma along an axis of the true camera's image, or its z; `object_within_sigma_image`,
/// `object_within_sigma_depth`. Nothing of a frame at which nobody looked.
///
/// @param truth  null: not known
MetricValues sigma_values(const PlaceSigmas& sigmas, const FrameState& estimate, const FrameState* truth);

}  // namespace hsi4d
