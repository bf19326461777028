// An avatar: Gaussians in the rest pose of a skeleton, bound to its joints.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "body/body_model.h"
#include "body/color_net.h"
#include "body/kinematics.h"
#include "body/skinning.h"
#include "core/safetensors.h"

namespace hsi4d {

/// Gaussians on a body in its rest pose (see BodyModel for the frame), with skeleton and skinning weights.
struct Avatar {
  std::vector<float> means;              ///< [N,3] metres
  std::vector<float> quats;              ///< [N,4] wxyz
  std::vector<float> log_scales;         ///< [N,3] log of metres
  std::vector<float> opacity_logits;     ///< [N]
  std::vector<float> colors;             ///< [N,3] RGB
  SparseWeights weights;                 ///< 4 a Gaussian
  std::vector<int> parents;              ///< [J], −1 for the root, which is joint 0; a joint comes after its parent
  std::vector<double> joints;            ///< [J,3] metres, rest pose
  std::vector<std::string> joint_names;  ///< [J]
  std::string body = {};                 ///< BodyModel::name of the body that it was made on; empty: not known
  std::optional<ColorNet> color_net;     ///< what makes the colours follow the pose; none: `colors` as they are

  Index count() const { return static_cast<Index>(opacity_logits.size()); }
  Index joint_count() const { return static_cast<Index>(parents.size()); }
};

/// How surface_avatar places Gaussians.
struct AvatarSettings {
  Index gaussians = 5000;
  double cover = 0.7;      ///< tangent scale over the mean distance of neighbours
  double thickness = 0.2;  ///< normal scale over tangent scale
  double opacity = 0.98;
  double detail = 1;   ///< how much denser head, hands and feet are: 0 not at all, 1 as designed (fingers six times)
  double texture = 1;  ///< contrast of the patterns of the clothes: 0 plain, 1 as designed
  std::uint64_t seed = 0;
};

/// Disc-shaped Gaussians spread evenly over a body's surface, denser on head and hands, coloured as skin, hair, shirt,
/// trousers and shoes by the joint that moves them and where they lie; the clothes have patterns, so that a photometric
/// loss has something to hold on to.
///
/// @param body  in the SMPL-X layout (its joint names tell the regions), with a surface
/// @return      exactly settings.gaussians Gaussians; a function of the arguments alone
/// Throws UserError when a setting is out of range, InternalError when the body has no surface or other joints.
Avatar surface_avatar(const BodyModel& body, const AvatarSettings& settings = {});

/// As pose_skeleton and pose_joints of kinematics.h.
PosedJoints pose_skeleton(const Avatar& avatar, const BodyPose& pose);
std::vector<double> pose_joints(const Avatar& avatar, const BodyPose& pose);

/// Throws InternalError when the sizes of the members do not fit each other.
void check_sizes(const Avatar& avatar);

/// The Gaussians of these rows on the same skeleton, its color net's features of them alone. Throws InternalError for a
/// row that is not there.
Avatar selected(const Avatar& avatar, std::span<const Index> rows);

/// Version of avatar files that is written; older ones are read, newer ones refused.
inline constexpr int kAvatarVersion = 2;

/// An avatar's file (docs/avatar.md): safetensors of format "hsi4d avatar", with F32 `means` [N,3], `quats` [N,4],
/// `log_scales` [N,3], `opacity_logits` [N], `colors` [N,3]; I32 `weight_indices` [N,K] and F64 `weights` [N,K] (K of 1
/// to 8); I32 `parents` [J]; F64 `joints` [J,3]; the text `joint_names` and, where it is known, `body`; and the arrays
/// of a color net where it has one (add_color_net). Files of version 1, which are .npz archives, are read too; the
/// content says which it is, not the ending.
///
/// Weights are normalised (normalized_weights), quaternions are not.
/// Throws UserError when the file cannot be read; DataError naming file and array: another format or a newer version, a
/// shape that does not fit, a number that is not finite, a zero quaternion, parents that are no tree, weights that
/// normalized_weights refuses.
Avatar read_avatar(const std::string& path);
/// As read_avatar, of a file in memory. @param name  what messages call it
Avatar decode_avatar(std::span<const std::uint8_t> file, const std::string& name);

/// Writes an avatar's file in one step. Throws UserError when it cannot, InternalError as check_sizes.
void write_avatar(const std::string& path, const Avatar& avatar);

/// The arrays and texts of an avatar, of a file that may hold more; errors as read_avatar and write_avatar.
Avatar avatar_of(const Safetensors& file);
SafetensorsWriter avatar_file(const Avatar& avatar);

}  // namespace hsi4d
