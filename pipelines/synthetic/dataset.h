// Datasets with exact ground truth, made by code: a person who does something with an object in a scene, seen by a
// drifting camera.
//
//   scene.ply  objects/NAME.ply  avatar.safetensors              Gaussians; the object's are relative to their mean
//   video.mp4, or frames/0000.png ...                            8 bit (synthetic.video)
//   first_frame.png                                              frame 0, exact to 8 bit
//   masks/human/0000.png ...  masks/NAME/0000.png ...            8 bit grey: the share of the pixel
//   camera.json  initial.json  initial_motion.npz                frame 0 exact, later frames disturbed
//   people/NAME/avatar.safetensors, initial.json, initial_motion.npz   people beside the first one (synthetic.people);
//   masks/NAME/0000.png ...  truth/motion_of_NAME.npz
//   initial_objects.npz                               poses of the object, disturbed; only with object_noise_*
//   config.json                                                  a run config that names all this
//   synthetic.json                                               the settings that it was made with
//   truth/motion.npz  truth/objects.npz  truth/cameras.json
//   truth/surface.ply                                 a mesh of what is certainly solid (synthetic_solids)
//
// Of several clips (synthetic.clips) each has its own clips/NAME/ with frames, masks, camera, initial state and truth;
// config.json is that of a chain.
//
// An object's pose is x_world = exp(rotation) x_object + translation.
#pragma once

#include <filesystem>

#include "core/config_value.h"
#include "core/observer.h"
#include "pipelines/config/synthetic_settings.h"
#include "pipelines/synthetic/noise.h"
#include "splat/render_settings.h"

namespace hsi4d {

/// In the folder of a dataset that was generated: the settings that it was made with.
inline constexpr const char* kSyntheticFile = "synthetic.json";

/// How the video of a dataset is rendered. Not as the reconstruction renders: with hardly a cut, and at the
/// supersampled size, so that the pixel filter that the reconstruction should use is narrower, blur/supersample² + 1/16
/// pixels² for a supersample of 2.
RenderSettings video_render_settings();

/// Writes a dataset: the same bytes for the same settings, for any number of threads.
///
/// @param folder         new or empty; its parents are made. It appears when everything in it is complete
/// @param more_sections  an object: sections of config.json beside `data`, for example stages; null: none
/// @param body_settings  who is seen
/// Throws as rest_body of the settings; UserError when ffmpeg is needed and missing, when the folder is there and not
/// empty, or cannot be written; Interrupted when asked to stop: then nothing is left.
void write_dataset(const SyntheticSettings& settings, const RenderSettings& render, const std::filesystem::path& folder,
                   const Observer& observer = {}, const ConfigValue& more_sections = ConfigValue::make_object(),
                   const BodySettings& body_settings = {});

}  // namespace hsi4d
