// The frame in which six numbers move a camera.
#pragma once

#include "core/camera.h"
#include "pipelines/config/run_config.h"
#include "splat/gaussians.h"

namespace hsi4d {

/// The matrix that takes six numbers (translation, rotation) in the frame of `increment` to the camera's frame, so that
/// T ← Exp(ξ) T is the update: the adjoint of the frame's own transform, [R, hat(t) R; 0, R].
///
/// @param camera  its pose is the one that the update starts from
Matrix6<double> camera_from_increment(CameraIncrement increment, const Camera& camera, const Gaussians& scene);

}  // namespace hsi4d
