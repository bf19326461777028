// Motions of bodies, changed: other frame rates, another world, another body's pelvis.
#pragma once

#include <cstdint>
#include <set>

#include "body/avatar.h"
#include "body/motion_io.h"
#include "body/pose_layout.h"
#include "body/smplx_sequence.h"
#include "core/rigid.h"

namespace hsi4d {

/// Between two poses: every joint turns at constant speed along the shorter way (slerp), the translation is linear.
///
/// @param u  0 gives a, 1 gives b, bit for bit
/// Throws InternalError when the poses have different numbers of joints.
BodyPose interpolated(const BodyPose& a, const BodyPose& b, double u);

/// Frames that resampled makes at most.
inline constexpr double kMostFrames = 1e6;

/// The same movement in another frame rate: frame k is at k / frame_rate seconds, from the first frame of `motion` to
/// the last that is not after its end. Frames that coincide keep their bits.
///
/// Throws UserError when that makes more than kMostFrames; InternalError when there is no frame or a rate is not
/// positive and finite.
Motion resampled(const Motion& motion, double frame_rate);

/// The same movement in another world, x_to = R x + c. A body turns about its pelvis and not about the origin, so
///
///   R_0' = R R_0,   t' = R t + (R − I) r_0 + c,
///
/// as pelvis (r_0 + t) and surface both move rigidly.
///
/// @param to_from       R and c
/// @param pelvis_rest   r_0 [3] metres: rest_body(model, betas).joints of joint 0, or kSmplxPelvis
Motion transformed(const Motion& motion, const Rigid<double>& to_from, const Vector3<double>& pelvis_rest);

/// As above, with a transform a frame. Throws InternalError when there are not as many as frames.
Motion transformed(const Motion& motion, const std::vector<Rigid<double>>& to_from, const Vector3<double>& pelvis_rest);

/// z up from y up: (x, y, z) → (x, −z, y).
Rigid<double> z_up_from_y_up();

/// The same movement of a body whose pelvis stands elsewhere in its rest pose: t' = t + from − to; `pelvis_rest` is
/// `to`. Translations keep their bits where the two are the same.
Motion with_pelvis(const Motion& motion, const Vector3<double>& from, const Vector3<double>& to);

/// The motion for a body to use it on: its pelvis is put where the motion has it, and `pelvis_rest` is the body's.
///
/// A motion that does not say where its pelvis stands in the rest pose is one of SMPL-X. On a body called
/// kProceduralName its pelvis is then taken for kSmplxPelvis; any other body is taken for the one that the motion is of
/// (an avatar of a person in a shape, and the motion of that person), and translations stay as they are.
///
/// @param name    of the body: BodyModel::name, Avatar::body
/// @param pelvis  where the body's pelvis stands in its rest pose, metres
Motion for_body(const Motion& motion, std::string_view name, const Vector3<double>& pelvis);
Motion for_body(const Motion& motion, const BodyModel& body);
Motion for_body(const Motion& motion, const Avatar& avatar);

/// Where the root stands in the rest pose, metres.
/// @param joints  [J,3], of a body or an avatar
Vector3<double> pelvis_of(std::span<const double> joints);

/// Hands as they are, of hands that a file gives relative to the model's mean hands, as SMPLer-X does.
Motion with_hand_means(const Motion& motion, const SmplxModel& model);

/// A motion of SMPL-X parameters.
///
/// Throws DataError naming the file when a hand is given by components.
Motion motion_of(const SmplxSequence& sequence, double frame_rate);

/// What read_pose_folder found.
struct PoseFolder {
  Motion motion;
  Index files = 0;               ///< that were read
  Index filled = 0;              ///< frames without a file, interpolated between their neighbours
  bool counts_from_one = false;  ///< the folder's first file, of anybody, is of frame 1, which is the video's first
  std::set<std::int64_t> other_people = {};  ///< of whom there are files that are not read
};

/// Frames a second of such a folder where nobody says: that of most videos.
inline constexpr double kPoseFolderRate = 30;

/// Reads a folder of SMPL-X parameters, a file a frame as SMPLer-X writes them: FRAME.npz or FRAME_PERSON.npz, or
/// TEXT_FRAME…; FRAME is the first run of digits, PERSON one after it. See read_smplx_sequence for what is in them. The
/// shape is the mean of all frames. As everything of SMPLer-X it is in the camera's frame (see transformed), and hands
/// are relative to the model's mean hands (see with_hand_means). The number of the first file is Motion::first_frame,
/// counted from 0; from 1 in a folder whose first file, of anybody, is of frame 1, as SMPLer-X counts.
///
/// @param person  files of others are passed over; files without a person are those of 0
/// Throws UserError when the folder cannot be read or has no such file; DataError as read_smplx_sequence, for a file
/// without `global_orient` or `body_pose`, of several frames, two of the same frame, frames more than 1000 apart, and
/// shapes of different lengths.
PoseFolder read_pose_folder(const std::string& folder, double frame_rate, int person = 0);

}  // namespace hsi4d
