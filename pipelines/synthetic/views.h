// Pictures of a made human in several poses from all sides, with what is known of them: a set for `hsi4d avatar fit`.
#pragma once

#include <vector>

#include "body/avatar.h"
#include "core/camera.h"
#include "core/observer.h"
#include "pipelines/config/synthetic_settings.h"
#include "pipelines/draw/image_of_scene.h"

namespace hsi4d {

/// Poses that show all of a body: arms away from it, limbs bent, turned; standing in the same place, z up.
/// @param body  in the SMPL-X layout
std::vector<BodyPose> view_poses(const BodyModel& body, Index count);

/// Cameras in a ring around a body that stands at the origin, alternately at the height of the hips and from above; it
/// fills most of the picture.
std::vector<Camera> ring_of_cameras(Index count, int size_px);

/// Gaussians as a camera sees them: 4 channels, colours and alpha, not premultiplied.
/// @param supersample  rendered at this multiple of the size and reduced
Image picture_with_alpha(const PosedGaussians& posed, const Camera& camera, const RenderSettings& render,
                         Precision precision, int supersample);

/// The colours of such a picture before black.
Image before_black(const Image& picture);

/// Writes views.json, motion.npz, cameras.json, the pictures and the avatar that they show (truth/avatar.safetensors):
/// settings.views_cameras × settings.views_poses pictures. The same bytes for the same settings.
///
/// @param folder  new or empty; it appears when everything in it is complete
/// Throws as write_dataset.
void write_views(const SyntheticSettings& settings, const RenderSettings& render, const std::filesystem::path& folder,
                 const Observer& observer = {}, const BodySettings& body = {});

}  // namespace hsi4d
