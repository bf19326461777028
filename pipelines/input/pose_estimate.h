// Poses of the human that another program has estimated from a video.
#pragma once

#include <filesystem>
#include <vector>

#include "body/avatar.h"
#include "body/motion_io.h"
#include "core/rigid.h"
#include "pipelines/config/data_settings.h"
#include "pipelines/input/frame_source.h"

namespace hsi4d {

/// Estimated poses of the clip's frames: those of the motion when it has more than frame 0, else none. It has a pose
/// for each frame that the clip keeps, or each of the video, or a rate of its own, at which it reaches to the clip's
/// end. One that begins with a later frame of the video (Motion::first_frame) is put there; poses before it are its
/// first step carried back, for two frames at most, which a warning says.
///
/// @param file  what messages call it
/// Throws DataError for another number of poses, and for a motion that begins after the clip's last frame.
std::vector<BodyPose> estimated_poses(const Motion& motion, const std::filesystem::path& file,
                                      const FrameSource& frames);

/// Reads an estimate for the body of an avatar: a pose for each frame of the clip, in a world with z up. Which axis is
/// up the body of frame 0 tells; a motion with y up is turned, and a warning says so. Of one that is laid by `rotation`
/// it does not matter.
///
/// @param first  the human of frame 0
/// Throws as read_motion and estimated_poses, for a motion of one pose too; DataError where y points down, as in a
/// camera's frame.
std::vector<BodyPose> read_estimate(const std::filesystem::path& file, const Avatar& avatar, const FrameSource& frames,
                                    const BodyPose& first, MotionAlign align);

/// A pelvis in the world: the root's rotation, and its place r_0 + t.
/// @param pelvis_rest  r_0, of the body that the pose is of, metres
Rigid<double> world_pelvis(const BodyPose& pose, const Vector3<double>& pelvis_rest);

/// What brings the world of an estimate to the one that is meant, as an estimator's world is not the scene's:
///
///   x ↦ R x + c with   R = R_z(θ), θ that which brings R_z(θ) E nearest to F   (heading)
///                      R = F Eᵀ                                              (rotation)
///
/// E and F are the rotations of the two pelvises, and c puts the one's place on the other's. `heading` keeps what the
/// estimator knows of the vertical; both worlds have z up. `none` changes nothing.
///
/// @param from, to  world_pelvis of the estimate, each by its own body, and where it is meant to be
Rigid<double> world_laid_on(const Rigid<double>& from, const Rigid<double>& to, MotionAlign align);

/// Moves an estimate by world_laid_on so that its frame 0 stands where the human of frame 0 does. Frame 0 becomes
/// `first`, bit for bit, which is exact.
///
/// @param pelvis_rest  of the body that all poses are of, metres
std::vector<BodyPose> laid_on(std::vector<BodyPose> estimate, const BodyPose& first, const Vector3<double>& pelvis_rest,
                              MotionAlign align);

}  // namespace hsi4d
