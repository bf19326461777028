// Files of body motion, as AMASS and SMPL-X name their arrays.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "body/pose.h"

namespace hsi4d {

/// Poses of a body of the SMPL-X layout (55 joints), one a frame.
struct Motion {
  double frame_rate = 10;  ///< frames a second
  std::vector<BodyPose> poses;
  std::vector<double> betas = {};  ///< numbers of the body's shape; empty: not known
  std::string gender = "neutral";  ///< of the body model
  /// Where the pelvis of the body that the translations are for stands in its rest pose, metres: in the world it is at
  /// pelvis_rest + transl. None: the file does not say; a body of SMPL-X with these betas.
  std::optional<Vector3<double>> pelvis_rest = {};
  std::string converted_from = {};       ///< "SMPL-H" or "SMPL", of whose poses these were made; empty: SMPL-X's own
  bool lost_shape = false;               ///< the file's betas are of that model, and left out
  double first_frame = 0;                ///< frame of its video, at frame_rate, from 0, that the first pose is of
  std::vector<std::string> unread = {};  ///< arrays of the file that are not read and may say more, in its order
  bool says_frame_rate = true;           ///< false: the file that it was read from does not; frame_rate is the default
};

/// Frame rates of motion files, frames a second.
inline constexpr double kSlowestMotion = 0.01, kFastestMotion = 1e5;

/// Reads a motion (.npz): `trans` [T,3] (or `transl`) and the rotations as axis-angle vectors, in radians.
///
/// The rotations are `poses` [T,D]: D = 165 SMPL-X; 156 SMPL-H (body and hands; no jaw, no eyes); 66, 69 or 72 SMPL (22
/// to 24 joints, of which the two hand joints are left out: they have no place in the other layouts). Or they are
/// parts: `root_orient` [T,3] (or `global_orient`), `pose_body` [T,63] (or `body_pose`), `pose_jaw` [T,3] (or
/// `jaw_pose`), `pose_eye` [T,6] (or `leye_pose` and `reye_pose` [T,3]), `pose_hand` [T,90] (or `left_hand_pose` and
/// `right_hand_pose` [T,45]); parts that are not there are zero, either half of the eyes and the hands too, but
/// root_orient and pose_body must be there. Where a file says a thing twice, `poses` wins over its parts, and
/// `pose_eye` and `pose_hand` win over their halves. The frame rate is `mocap_frame_rate` (or `mocap_framerate`); 10
/// where neither is there. `betas` is [B], [1,B] or [T,B], of which the mean is taken; `gender` a text. `pelvis_rest`
/// [3] is Motion::pelvis_rest. `first_frame`, or the first of `frame_ids` [T] (WHAM), is Motion::first_frame.
///
/// Other names are read too, each as the one that it stands for: `human_transl` and `transl_aligned`, `human_orient`,
/// `human_pose` (the data sets of TRUMANS and LINGO), `trans_world` and `pose_world` (WHAM, SMPL); `frame_rate` and
/// `fps`. Parts may be [T,J,3].
///
/// A text `surface_model_type`, "smplx", "smplh" or "smpl" (in any spelling, or with more after it), says of what model
/// 156 or 66 numbers and parts are; without it parts are of SMPL-X. What is not becomes a motion of the neutral SMPL-X
/// of mean shape: its pelvis is put where that of the file's model is (`pelvis_rest`, else of the neutral model of mean
/// shape), betas and gender are left out.
///
/// Throws UserError when the file cannot be read; DataError naming file and array: a file of something else, an array
/// missing or of Python objects, a shape that does not fit, no frame, a number that is not finite or beyond 1e6 (of
/// translations 1e7; of betas kLargestBeta), angles in degrees (half of the body's joints that are turned are turned by
/// more than half a circle), more than kMostBetas betas, a frame rate outside kSlowestMotion to
/// kFastestMotion.
Motion read_motion(const std::string& path);
/// As read_motion, of a file in memory. @param name  what messages call it
Motion decode_motion(std::span<const std::uint8_t> file, const std::string& name);

/// Writes a motion, float64, so that reading gives the same bits, with all that AMASS's readers and the SMPL-X Blender
/// add-on look for: `poses` [T,165] and its parts as above, `trans`, `betas` (zeros up to 10 of them), `gender`,
/// `surface_model_type` "smplx", `mocap_frame_rate` and `mocap_framerate`, `mocap_time_length`; and `pelvis_rest`
/// where it is known. The add-on wants at least the rate that it is asked to import at, 30 unless told otherwise: see
/// resampled (motion_edit.h).
///
/// @param joint_sigmas  [T,J,2] how sure the places of the first J joints are: one standard deviation across the view
/// of
///                      the frame's camera, and along it, metres; written as `joint_sigma`. Empty: not known
/// Throws UserError when the file cannot be written, InternalError when there is no frame, a
/// pose has not 55 joints, or the frame rate is not positive.
void write_motion(const std::string& path, const Motion& motion, const std::vector<double>& joint_sigmas = {});

/// Reads `joint_sigma` of a motion; empty where it has none. Infinite: nothing tells the place; not a number: nobody
/// looked.
///
/// Throws as read_motion: a shape that is not [T,J,2] for the T frames of the file, a negative number.
std::vector<double> read_joint_sigmas(const std::string& path);
/// As read_joint_sigmas, of a file in memory. @param name  what messages call it
std::vector<double> decode_joint_sigmas(std::span<const std::uint8_t> file, const std::string& name);

}  // namespace hsi4d
