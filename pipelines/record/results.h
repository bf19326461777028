// The files in which a run leaves its result.
#pragma once

#include <array>
#include <functional>
#include <optional>

#include "body/body_model.h"
#include "pipelines/config/run_config.h"
#include "pipelines/input/clip.h"
#include "pipelines/input/color_state.h"
#include "pipelines/record/folder.h"

namespace hsi4d {

/// Whether some stage moves the color net.
bool moves_colors(const RunConfig& config);

/// The rate of the copy of the motion that other programs take, the SMPL-X add-on for Blender for example.
inline constexpr double kExportedRate = 30;

/// Writes motion.npz, motion_30fps.npz, objects.npz, cameras.json, and color_net.safetensors where a stage moved it.
/// @param states  the result by frame, frame 0 included
/// @param sigmas  how sure its places are, by frame; empty: nobody asked
void write_results(const RunPaths& paths, const RunConfig& config, const Clip& clip,
                   const std::vector<SceneState>& states, const ColorState& colors,
                   const std::vector<PlaceSigmas>& sigmas = {});

/// The bodies of the frames as motion.npz has them.
Motion motion_of(const Clip& clip, const std::vector<SceneState>& states, std::size_t person = 0);

/// Writes body.glb, the body in motion. It has to be the avatar's: of its kind, and with joints where the avatar has
/// them. Where it is another the log says so, and no file is written.
/// @return  the body; nothing where it is another, or cannot be read
std::optional<BodyModel> write_body(const RunPaths& paths, const BodySettings& body, const Avatar& avatar,
                                    const Motion& motion);

using StateRenderer =
    std::function<Image(Index frame, const SceneState& state, const std::optional<std::array<double, 3>>& background)>;

/// Writes what a viewer shows: frames/NNNN_side.png of every frame, the reconstruction from another side; frame 0 as it
/// was given, frames/0000_{target,render}.png; and preview.mp4: video, reconstruction, both one over the other, and the
/// other side, next to each other. The other side has the mean colour of the video's frame 0 behind everything, as a
/// scene that was made of one view ends soon beside it. Where ffmpeg fails the log says so, and no video is written.
///
/// @param preview  whether there is to be a preview.mp4
/// @param render  the image of a state of a frame, from the state's camera, before the colour that is given; none: that
///                of the config
void write_views(const RunPaths& paths, const Clip& clip, const std::vector<SceneState>& states,
                 const StateRenderer& render, bool preview);

/// A camera that looks from another side: turned about the vertical axis through `pivot`.
///
/// @param pivot  metres, world
/// @param angle  radians, counter-clockwise from above
Rigid<double> turned_camera(const Rigid<double>& camera_from_world, const Vector3<double>& pivot, double angle);

}  // namespace hsi4d
