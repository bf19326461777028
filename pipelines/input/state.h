// The state that is reconstructed, frame by frame, and its files.
#pragma once

#include <string>
#include <vector>

#include "body/pose.h"
#include "core/camera.h"
#include "core/rigid.h"

namespace hsi4d {

/// Pose of a rigid object: x_world = exp(rotation) x + translation, x relative to the centroid of its means.
struct ObjectPose {
  Vector3<double> rotation = Vector3<double>::Zero();     ///< axis-angle, radians
  Vector3<double> translation = Vector3<double>::Zero();  ///< metres, world
};

/// Everything that moves, at one frame.
struct SceneState {
  Rigid<double> camera_from_world;
  std::vector<ObjectPose> objects;  ///< in the clip's order
  BodyPose body;
};

/// Writes objects.npz: NAME/rotation [T,3] and NAME/translation [T,3], float64.
void write_object_tracks(const std::string& path, const std::vector<std::string>& names,
                         const std::vector<SceneState>& frames);

/// Reads objects.npz: poses[frame][object] in the order of `names`. Throws DataError naming the file and the array when
/// one is missing or its shape is wrong.
std::vector<std::vector<ObjectPose>> read_object_tracks(const std::string& path, const std::vector<std::string>& names);

/// The bodies of the frames.
std::vector<BodyPose> bodies_of(const std::vector<SceneState>& frames);

/// The cameras of the frames, with the intrinsics of `camera`.
std::vector<Camera> cameras_of(const std::vector<SceneState>& frames, const Camera& camera);

}  // namespace hsi4d
