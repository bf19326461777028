// The groups of parameters that stages move, by name.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "core/types.h"
#include "optim/stage_settings.h"

namespace hsi4d {

/// Rows of the SMPL-X pose that a group of parameters holds.
struct JointGroup {
  const char* name;
  Index first, count;
  const char* summary;
};
inline constexpr std::array<JointGroup, 7> kJointGroups = {
    {{"global_orient", 0, 1, "Heading of the body"},
     {"body_pose", 1, 21, "21 joints of the body"},
     {"jaw_pose", 22, 1, "The jaw"},
     {"leye_pose", 23, 1, "The left eye"},
     {"reye_pose", 24, 1, "The right eye"},
     {"left_hand_pose", 25, 15, "15 joints of the left hand"},
     {"right_hand_pose", 40, 15, "15 joints of the right hand"}}};

/// Groups of the color net, which all frames share, of the place of the body, and of its heading.
inline constexpr const char* kColorNetGroup = "color_net";
inline constexpr const char* kFeaturesGroup = "avatar_features";
inline constexpr const char* kTranslGroup = "transl";
inline constexpr const char* kOrientGroup = "global_orient";
/// The groups of what places the objects, of those on a joint the last.
inline constexpr const char* kObjectOrientGroup = "object_orient";
inline constexpr const char* kObjectTranslGroup = "object_transl";
inline constexpr const char* kObjectJointGroup = "object_joint";
/// The group of the light on objects (pipelines/draw/object_light.h).
inline constexpr const char* kObjectLightGroup = "object_light";
/// The group of the latents of the pose prior, which stand for the joints.
inline constexpr const char* kPoseLatents = "pose_latents";

/// Names of the groups of a frame graph, by what it draws.
std::vector<std::string> parameter_group_names(Draw draw);

/// Those of them that a stage may move: what read_state brings back. The Gaussians' own numbers and the background are
/// groups for gradient checks.
std::vector<std::string> state_group_names(Draw draw);
/// Groups of what the files of a clip do not know: one number, or one an object, or the betas, for all frames. Stages
/// over the first frame alone may move them.
inline constexpr const char* kFocalGroup = "focal_length";
inline constexpr const char* kObjectScaleGroup = "object_scale";
inline constexpr const char* kSceneScaleGroup = "scene_scale";
inline constexpr const char* kSceneHeightGroup = "scene_height";
inline constexpr const char* kBetasGroup = "betas";

/// Their names, by what the stage draws.
std::vector<std::string> unknown_group_names(Draw draw);
/// Those of them that a stage moves.
std::vector<std::string> unknown_groups_of(const StageSettings& stage);

/// A group of the state, or an unknown one, in words: "Place of the body". Throws InternalError for another name.
std::string state_group_summary(const std::string& name);

/// Names of the groups that a stage over the sequence may move.
std::vector<std::string> sequence_group_names();
/// One of them in words. Throws InternalError for another name.
std::string sequence_group_summary(const std::string& name);

}  // namespace hsi4d
