// Keypoints of pictures that a lens bends.
#pragma once

#include "core/camera.h"
#include "core/lens.h"
#include "pipelines/input/keypoints.h"

namespace hsi4d {

/// Moves keypoints to where a pinhole would have shown them.
/// @param camera  whose intrinsics the lens goes with
void straighten(const Lens& lens, const Camera& camera, Keypoints& keypoints);

}  // namespace hsi4d
