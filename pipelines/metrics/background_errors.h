// How far the background of a frame is from what the run draws of it, apart from brightness.
#pragma once

#include "core/image.h"
#include "pipelines/metrics/metric_facts.h"

namespace hsi4d {

/// Two metrics of pictures that are reduced to at most 256 pixels, over their background:
///
///   camera_drift_px    mean |u(x)|, u the similarity (shift, growth, turn) with which frame(x + u) is nearest to
///                      g render + b. Least squares with weights (1 + (d/0.1)²)⁻² of the grey difference d, from
///                      coarse to fine, so up to about a twentieth of the picture. None where the background has so
///                      little texture that noise of 0.02 would make more than 0.1 px of it
///   background_change  share of the pixels whose colour, with the displacement taken back, is in some channel more
///                      than 0.1 beyond all that g render + b has there and one pixel around
///
/// with a gain g of ½ to 2 and an offset b, for grey or for each channel. Nothing where less than 1 % is background.
///
/// @param render, frame  [3,H,W]
/// @param background     [1,H,W] 1, or 0 where something moves or is not seen
/// @return               pixels of the images as they are given; a share
MetricValues background_errors(const Image& render, const Image& frame, const Image& background);

}  // namespace hsi4d
