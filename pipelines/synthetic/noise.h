// What estimators get wrong: initial poses of body and object, and masks.
#pragma once

#include <cstdint>
#include <vector>

#include "body/motion_io.h"
#include "core/image.h"
#include "core/rigid.h"
#include "pipelines/config/synthetic_settings.h"

namespace hsi4d {

/// `truth` with noise on every frame but the first, as an estimator would have it. Joints 1-21 are turned by three
/// errors, each with the root mean square angle of its setting: another in each frame (pose_noise_deg), one that stays
/// for seconds (pose_bias_deg) and one that grows linearly through the clip (pose_drift_deg). Finger joints have
/// hand_noise_share of each, the root root_noise_deg alone; it is moved by root_noise_m (each coordinate's standard
/// deviation, another in each frame) and root_drift_m (growing). Jaw and eyes stay.
Motion disturbed_motion(const Motion& truth, const SyntheticSettings& settings);

/// Poses of an object with noise on every frame but the first: turned about its centroid by object_noise_deg (root mean
/// square angle), moved by object_noise_m (each coordinate's standard deviation).
std::vector<Rigid<double>> disturbed_object(const std::vector<Rigid<double>>& truth, const SyntheticSettings& settings);

/// A mask as a segmenter would have it: grown or eaten away, jagged, or empty.
///
/// A boundary is moved outward by grow_px + jagged_px n(u), n smooth noise of about 8 pixels, another in each frame: a
/// pixel takes the largest (or, inward, the smallest) value within that distance. Frame 0 is never dropped.
///
/// @param mask  [1,H,W]
/// @param name  whose mask: another name has other noise
Image disturbed_mask(const Image& mask, const SyntheticMaskNoise& noise, std::uint64_t seed, std::string_view name,
                     Index frame);

}  // namespace hsi4d
