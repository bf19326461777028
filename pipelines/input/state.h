// The state that is reconstructed, frame by frame, and its files.
#pragma once

#include <array>
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

/// world_from_object.
Rigid<double> rigid_of(const ObjectPose& pose);
std::vector<Rigid<double>> rigids_of(const std::vector<ObjectPose>& poses);
/// The pose of it, the angle up to π.
ObjectPose pose_of(const Rigid<double>& world_from_object);

/// Light on an object beside that of its file (pipelines/draw/object_light.h): logarithms of the factors of red, green
/// and blue, then the vector l of a factor exp(n·l), n the normal in the world.
using ObjectLight = std::array<double, 6>;

/// Everything that moves, at one frame.
struct SceneState {
  Rigid<double> camera_from_world;
  std::vector<ObjectPose> objects;    ///< in the clip's order
  BodyPose body;                      ///< of the clip's first person
  std::vector<BodyPose> others{};     ///< of the people beside it, in the clip's order
  std::vector<ObjectLight> lights{};  ///< of the objects, or empty: none

  std::size_t people() const { return 1 + others.size(); }
  BodyPose& person(std::size_t p) { return p == 0 ? body : others.at(p - 1); }
  const BodyPose& person(std::size_t p) const { return p == 0 ? body : others.at(p - 1); }
};

/// The light on an object; zeros where there is none.
ObjectLight light_of(const SceneState& state, std::size_t object);

/// How sure a place is in the axes of its frame's camera: one standard deviation, metres. Infinite: nothing tells it;
/// not a number: nobody looked, as in a frame that is given.
struct PlaceSigma {
  double across = 0;  ///< along each of the image's two axes, their quadratic mean
  double along = 0;   ///< along the camera's z

  bool operator==(const PlaceSigma&) const = default;
};

/// How sure the places of a frame are.
struct PlaceSigmas {
  std::vector<PlaceSigma> joints;                    ///< of the first kMetricJoints (optim/metrics.h)
  std::vector<PlaceSigma> objects;                   ///< of their centroids, in the clip's order
  std::vector<std::vector<PlaceSigma>> others = {};  ///< joints of the people beside the first, in the clip's order

  bool operator==(const PlaceSigmas&) const = default;
};

/// Of a frame that nobody looked at.
/// @param others  people beside the first
PlaceSigmas no_sigmas(std::size_t objects, std::size_t others = 0);

/// How far an object has moved on its joint, by frame (pipelines/input/object_joint.h).
struct JointTrack {
  std::string object;
  std::vector<double> values;  ///< [T] radians or metres
};

/// Writes objects.npz: NAME/rotation [T,3] and NAME/translation [T,3], NAME/sigma [T,2] (across, along) where it is
/// known, NAME/light [T,6] (ObjectLight) where the last frame has one, and NAME/joint [T] of objects on joints;
/// float64.
/// @param sigmas  by frame; empty: not known
void write_object_tracks(const std::string& path, const std::vector<std::string>& names,
                         const std::vector<SceneState>& frames, const std::vector<PlaceSigmas>& sigmas = {},
                         const std::vector<JointTrack>& joints = {});

/// The joints' as motion.npz has them: [T,kMetricJoints,2] (across, along), metres; empty where none are known.
std::vector<double> joint_sigmas_of(const std::vector<PlaceSigmas>& sigmas);

/// Reads what motion.npz and objects.npz of a run say of how sure places are, by frame; nothing where the motion does
/// not say it. Throws DataError naming the file and the array when the shape of one is wrong, or a number is negative.
std::vector<PlaceSigmas> read_place_sigmas(const std::string& motion, const std::string& objects,
                                           const std::vector<std::string>& names);

/// Reads objects.npz: poses[frame][object] in the order of `names`. Throws DataError naming the file and the array when
/// one is missing or its shape is wrong.
std::vector<std::vector<ObjectPose>> read_object_tracks(const std::string& path, const std::vector<std::string>& names);

/// The bodies of the frames.
std::vector<BodyPose> bodies_of(const std::vector<SceneState>& frames, std::size_t person = 0);

/// The frames with one person alone, who is the first in them.
std::vector<SceneState> with_person(std::vector<SceneState> frames, std::size_t person);

/// The cameras of the frames, with the intrinsics of `camera`.
std::vector<Camera> cameras_of(const std::vector<SceneState>& frames, const Camera& camera);

}  // namespace hsi4d
