// Where things are in a frame: masks by their coverage, objects by their Gaussians' centres.
#pragma once

#include "core/camera.h"
#include "core/image.h"
#include "pipelines/input/state.h"
#include "splat/gaussians.h"

namespace hsi4d {

/// Centre of a mask's coverage (pixel centres at +0.5) in x and y, and that coverage, pixels; zeros for a mask that
/// nowhere reaches the threshold, as its faint pixels may be anything.
Vector3<double> mask_center(const Image& mask, double threshold);

/// Mean camera z of an object's Gaussian centres, metres.
double mean_depth(const Gaussians& object, const ObjectPose& pose, const Rigid<double>& camera_from_world);

/// How many pixels an object would cover with nothing before it, by the spread Σ of its Gaussians' centres in the
/// image: 4π √det Σ, which is the area of an ellipse that they fill evenly.
double covered_area(const Gaussians& object, const ObjectPose& pose, const Camera& camera);

}  // namespace hsi4d
