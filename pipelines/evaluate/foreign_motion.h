// What motion files of other programs leave open: which way is up, and how they write poses of objects.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "body/motion_io.h"
#include "pipelines/input/state.h"

namespace hsi4d {

/// Which axis of a motion's world is up.
enum class UpAxis { kZ, kY };

/// What is known of a motion's world from elsewhere.
struct UpHints {
  std::optional<UpAxis> wanted = {};  ///< what is asked for; none: to be found
  bool fills_in = false;              ///< `wanted` is of files alone that do not say it themselves
  /// The direction that is up, in the root's frame of frame 0, R_0ᵀ e_z, of the body that the motion begins with.
  std::optional<Vector3<double>> upright = {};
};

/// What is taken for up, and why.
struct UpFinding {
  UpAxis up = UpAxis::kZ;
  std::string words;  ///< for people; empty where the file's own convention says it
};

/// A mean direction of the body's own up so far along an axis tells that this axis is up.
inline constexpr double kUprightShare = 0.7;

/// Which way is up in a motion's world: what is asked for; else as `upright` has it, which tells of who lies too; else
/// z of a file by AMASS's names (one that says `mocap_frame_rate` or `mocap_framerate`), as AMASS has it, which is told
/// where the posture speaks against it. By `upright`:
/// of z, y and −y the axis e whose R_0ᵀ e in frame 0 is nearest to it, where that makes kUprightShare; else by the
/// posture: the axis that the mean over frames of R_0 (0, 1, 0), from pelvis to head, lies along by kUprightShare of
/// its length at least. Where no axis does, as mostly of who lies, it is z.
///
/// @param path  of the motion's file
/// Throws DataError where y points down, as in a camera's frame: a world is needed. Errors as Npz::read.
UpFinding find_up(const std::string& path, const Motion& motion, const UpHints& hints);

/// Objects that a motion's file holds beside the body.
struct ForeignObjects {
  std::vector<std::string> names;
  std::vector<std::vector<ObjectPose>> poses;  ///< [frame][object]
  bool are_of_origins = false;                 ///< translations are those of the origins of the objects' files
};

/// Reads poses of objects from a motion's file: ours, NAME/rotation and NAME/translation; or those of one object as
/// CHOIS and OMOMO name them, `obj_rot_mat` (or `obj_rot`) [T,3,3] with `obj_com_pos` (or `window_obj_com_pos`) [T,3]
/// or [T,3,1], metres: where the mean of its mesh's vertices is. Where `obj_trans` alone is there, it is the place of
/// that mesh's origin. None where there are neither.
///
/// @param unnamed  what an object without a name is called
/// Throws DataError naming file and array: one of the two missing, a shape that does not fit, a number that is not
/// finite, a matrix that is no rotation; a name that no file may have.
ForeignObjects read_motion_objects(const std::string& path, const std::string& unnamed);

}  // namespace hsi4d
