// Adaptive density control [Kerbl et al. 2023, section 5.2]: what moves much in pictures becomes two, what is faint
// goes.
#pragma once

#include "autodiff/array.h"
#include "core/camera.h"
#include "pipelines/scan/density.h"

namespace hsi4d {

/// Adds the sizes of the loss's gradients by places in the image, in halves of the picture's width and height; a row
/// whose gradient is zero, or no number, was not seen.
///
/// @param d_means  [N,2] of N rows, pixels
void add_image_gradients(ConstArray<float> d_means, const Camera& camera, ScanState& state);

/// Rows whose mean gradient since the last change is above settings.gradient become two: a copy is added where they are
/// at most settings.split_size · extent in size; else two of 1/1.6 of the size, drawn from it, take their place. Where
/// settings.most lets not all, those of the largest gradients. Then rows fainter than settings.least_opacity go, and,
/// after the first reset, those larger than settings.most_size · extent; never all. At last, every
/// settings.reset_every iterations, opacities become at most twice the least, so that what is not needed shows. A
/// function of the arguments alone.
///
/// @param seed    and state.iteration: of the draws
/// @param extent  of the scene, metres
DensityChange split_and_prune(const DensitySettings& settings, std::int64_t seed, double extent, ScanState& state);

}  // namespace hsi4d
