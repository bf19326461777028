// What stands at the beginning of a clip: scene, objects and human in their first state. No camera and no video yet.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "body/avatar.h"
#include "body/motion_io.h"
#include "pipelines/config/data_settings.h"
#include "pipelines/input/object_joint.h"
#include "pipelines/input/state.h"
#include "splat/gaussians.h"

namespace hsi4d {

/// One rigid object that moves.
struct ClipObject {
  std::string name;
  Gaussians gaussians;                    ///< relative to the centroid of their means
  std::optional<ObjectJoint> joint = {};  ///< none: it moves freely
};

/// One person.
struct SetupPerson {
  Avatar avatar;
  Motion motion;  ///< of the avatar's body: frame 0 exact, the others, where there are any, estimates
  std::filesystem::path motion_file;
};

/// Its own person is the first.
struct SceneSetup : SetupPerson {
  Gaussians scene;
  std::vector<ClipObject> objects;
  std::vector<ObjectPose> poses;         ///< of the objects in frame 0
  std::vector<SetupPerson> others{};     ///< of data.people, in their order
  std::vector<std::string> antialiased;  ///< files that say that their Gaussians were trained with antialiasing
  std::filesystem::path
      object_tracks;  ///< estimated poses of the objects, NAME/rotation and NAME/translation; may be empty
};

/// An object's Gaussians, relative to the centroid of their means, whatever the file's are. Throws UserError or
/// DataError naming the file.
Gaussians read_object(const std::filesystem::path& file);

/// The motion that data.initial names. Throws UserError naming what is wrong with that file.
std::filesystem::path initial_motion_file(const DataSettings& data);

/// Reads data.scene, avatar, objects, people and initial. Throws UserError or DataError naming the file: missing,
/// damaged, without what is needed of it.
SceneSetup read_scene_setup(const DataSettings& data);

}  // namespace hsi4d
