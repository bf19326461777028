// How far a camera sees into Gaussians.
#pragma once

#include <vector>

#include "pipelines/draw/image_of_scene.h"

namespace hsi4d {

/// The depth at which half of each pixel's light is stopped: where the pixel's ray comes nearest to the middle of the
/// Gaussian that stops it (median_rows), in the measure of that Gaussian.
///
///   z = (dᵀ Σ⁻¹ m)/(dᵀ Σ⁻¹ d),  d = ((u − cx)/fx, (v − cy)/fy, 1),  m its mean in the camera's frame,
///
/// held to within three of its standard deviations along z from its mean. Harmonics are not looked at.
///
/// @return  [H,W] camera z, metres; 0 where less than half is stopped
/// Throws as render_scene.
std::vector<float> median_depths(const Gaussians& gaussians, const SceneView& view);

}  // namespace hsi4d
