// Pictures of a made scene or object with their cameras and depths: a set for `hsi4d reconstruct`.
#pragma once

#include <filesystem>
#include <vector>

#include "core/camera.h"
#include "core/observer.h"
#include "pipelines/config/synthetic_settings.h"
#include "pipelines/draw/image_of_scene.h"

namespace hsi4d {

/// Cameras in a scene that is open towards −y, at the heights of eyes and hands, looking at its middle from all places
/// where somebody could stand with a camera.
std::vector<Camera> cameras_in_scene(Index count, int size_px, std::uint64_t seed);

/// Whether a picture is worth taking: the camera is in nothing, and most of what it sees is there.
bool is_good_view(const SceneImage& picture);

/// Writes pictures of the scene or the object of the settings; a scene_file is taken as it is. Writes transforms.json
/// (OpenGL axes, as nerfstudio's), images/, depths/ (EXR, metres) and what they show (truth/scene.ply or
/// truth/object.ply): at most settings.photos pictures, of an object with alpha. Views that is_good_view refuses are
/// left out. The same bytes for the same settings.
///
/// @param folder  new or empty; it appears when everything in it is complete
/// Throws as write_dataset; UserError where no view is good.
void write_photos(const SyntheticSettings& settings, const RenderSettings& render, const std::filesystem::path& folder,
                  const Observer& observer = {});

}  // namespace hsi4d
