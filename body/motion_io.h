// Files of body motion, as AMASS and SMPL-X name their arrays.
#pragma once

#include <cstdint>
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
};

/// Reads a motion (.npz): `trans` [T,3] (or `transl`) and the rotations as axis-angle vectors, in radians.
///
/// The rotations are `poses` [T,D]: D = 165 SMPL-X; 156 SMPL-H (body and hands; no jaw, no eyes); 72 SMPL (24 joints,
/// of which the two hand joints are left out: they have no place in the other layouts). Or they are parts of
/// `root_orient` [T,3] (or `global_orient`), `pose_body` [T,63] (or `body_pose`), `pose_jaw` [T,3] (or `jaw_pose`),
/// `pose_eye` [T,6] (or `leye_pose` and `reye_pose` [T,3]), `pose_hand` [T,90] (or `left_hand_pose` and
/// `right_hand_pose` [T,45]); parts that are not there are zero, either half of the eyes and the hands too, but
/// root_orient and pose_body must be there. Where a file says a thing twice, `poses` wins over its parts, and
/// `pose_eye` and `pose_hand` win over their halves. The frame rate is `mocap_frame_rate` (or `mocap_framerate`); 10
/// where neither is there. `betas` is [B], [1,B] or [T,B], of which the mean is taken; `gender` a text.
///
/// Throws UserError when the file cannot be read; DataError naming file and array: an array missing, a shape that does
/// not fit, no frame, a number that is not finite, a frame rate that is not positive.
Motion read_motion(const std::string& path);
/// As read_motion, of a file in memory. @param name  what messages call it
Motion decode_motion(std::span<const std::uint8_t> file, const std::string& name);

/// Writes a motion, float64, so that reading gives the same bits, with all that AMASS's readers and the SMPL-X Blender
/// add-on look for: `poses` [T,165] and its parts as above, `trans`, `betas` (zeros up to 10 of them), `gender`,
/// `surface_model_type` "smplx", `mocap_frame_rate` and `mocap_framerate`, `mocap_time_length`. The add-on wants at
/// least the rate that it is asked to import at, 30 unless told otherwise: see resampled (motion_edit.h).
///
/// Throws UserError when the file cannot be written, InternalError when there is no frame, a
/// pose has not 55 joints, or the frame rate is not positive.
void write_motion(const std::string& path, const Motion& motion);

}  // namespace hsi4d
