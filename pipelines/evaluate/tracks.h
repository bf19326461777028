// Motions that are compared: of a body, objects and a camera over time, from the files of runs, datasets and other
// programs.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "body/avatar.h"
#include "body/motion_io.h"
#include "core/rigid.h"
#include "pipelines/evaluate/foreign_motion.h"
#include "pipelines/input/state.h"
#include "pipelines/metrics/sequence_errors.h"

namespace hsi4d {

/// What moves, by frame. Objects and cameras may be missing; what is there has as many frames as the body.
struct Track {
  std::string name;                                   ///< what messages call it: the path
  Motion motion;                                      ///< of the body
  std::vector<std::string> objects;                   ///< names, in the order of object_poses
  std::vector<std::vector<ObjectPose>> object_poses;  ///< [frame][object]; empty: none are known
  std::vector<Rigid<double>> camera_from_world;       ///< by frame; empty: none are known
  std::vector<bool> good_frames;                      ///< those that are measured by protocols; empty: all
  std::string world;  ///< what was found of its world, for people; empty: nothing to say
  /// Which axis of its world is up. A body turns about its pelvis, so that z is only then up when its body is known:
  /// see turn_z_up.
  UpAxis up = UpAxis::kZ;
  bool objects_stay = false;  ///< the objects' poses are in the scene's world, z up, and do not move with the track's
  bool objects_are_of_origins = false;  ///< their translations are those of the origins of the objects' files
  bool objects_are_of_meshes = false;   ///< their poses act about the mean of the vertices of the objects' meshes

  Index frames() const { return std::ssize(motion.poses); }
};

/// How motions of other programs are read.
struct TrackOptions {
  std::optional<double> frame_rate = {};        ///< frames a second of a motion, instead of what it says
  int person = 0;                               ///< of a folder of SMPLer-X
  std::optional<UpAxis> up = {};                ///< of a motion's world; none: find_up says it
  bool fills_in = false;                        ///< rate and `up` are of motions alone that do not say them themselves
  std::optional<Vector3<double>> upright = {};  ///< as UpHints has it
  std::string objects = {};  ///< a file of object poses in the scene beside a motion; empty: what it holds itself
  std::string object_name = "object";  ///< what an object without a name is called
};

/// Whether a folder is one that `hsi4d run` writes.
bool is_run_folder(const std::string& path);

/// Throws UserError where a path holds nothing that could be read as a track: it is not there, or is a folder without
/// run, dataset or motion. Then it names the folder `member` in it, where that is one.
/// @param member  "run" or "dataset", which hsi4d demo makes
void check_holds_track(const std::string& path, const std::string& member);

/// Reads what a path holds: a run folder (motion.npz, objects.npz, cameras.json), a dataset with truth/, such a truth/
/// itself, a motion (.npz), a sequence of BEHAVE (behave_sequence.h), or a folder of SMPLer-X (read_pose_folder). Of a
/// motion `good_frames_mask` [T], booleans or 0 and 1, is Track::good_frames, as EMDB calls it.
///
/// Throws UserError naming the path for anything else, a run that has not come to its end, and a dataset without truth;
/// UserError and DataError of the readers; DataError where counts of frames differ, or a file of object poses has none.
Track read_track(const std::string& path, const TrackOptions& options = {});

/// The avatar that belongs to a run folder (its config's), or to a dataset; empty where there is none.
std::string avatar_of_track(const std::string& path);

/// The truth that the config of a run folder names, of a chain that of each clip; empty where one is not named, or not
/// there.
std::vector<std::string> truths_of_run(const std::string& path);

/// Reads tracks of which each begins with the last frame of the one before, as one. Throws as read_track, and DataError
/// where they do not fit each other.
Track read_joined_tracks(const std::vector<std::string>& paths, const TrackOptions& options = {});

/// Moves a track to another world, x_to = R x + c: the body about its pelvis, its cameras, and its objects but for
/// those that stay. Its motion must say where the pelvis stands in the rest pose, as for_body makes it: else
/// InternalError.
void move_world(const Rigid<double>& to_from, Track& track);

/// Turns a track whose world has y up to z up, by move_world.
void turn_z_up(Track& track);

/// The file of the Gaussians of an object, by the config of a run folder or the dataset; empty where it is not there.
std::string object_file_of_track(const std::string& path, const std::string& object);

/// The names of the objects of a run folder's config, or of a dataset.
std::vector<std::string> object_names_of_track(const std::string& path);

/// The mesh of what is solid, and the scene's Gaussians, that belong to a run folder or a dataset; of a chain only
/// where all clips have the same. Empty where there is none.
std::string surface_of_track(const std::string& path);
std::string scene_of_track(const std::string& path);

/// The motion that begins with the state of frame 0 of a dataset or run; empty where there is none.
std::string initial_of_track(const std::string& path);

/// The body of a track at a moment of its video, seconds; where it has begun, and not ended.
BodyPose body_at(const Track& track, double seconds);

/// Between two poses: turns at constant speed, moves on a line.
Rigid<double> between_poses(const Rigid<double>& a, const Rigid<double>& b, double u);

/// A skeleton in its rest pose.
struct RestSkeleton {
  std::vector<int> parents;
  std::vector<double> joints;  ///< [J,3] metres
};

/// Frames a second of a track: what it says, else those of `other` where it has as many frames. Throws UserError naming
/// the track where nobody knows.
double rate_beside(const Track& track, const Track& other);

/// Two tracks at the same moments.
struct AlignedTracks {
  double frame_rate = 0;  ///< frames a second of both
  Index first = 0;        ///< the frame, at this rate, that both have first
  std::vector<FrameState> estimate, truth;
  std::vector<SceneState> states;       ///< the estimate's bodies and all of its objects; no cameras
  std::vector<SceneState> true_states;  ///< the truth's; empty without one
  std::vector<bool> good;  ///< whether both frames of the truth about a moment are good ones; as true_states
};

/// Both tracks at the frames of the slower one, from the first frame that both have on, as long as both last. Between
/// frames rotations turn at constant speed, places are linear; moments within 1e-6 frames of a frame are that frame. A
/// track that does not say its rate has the other's if it has as many frames.
///
/// @param estimate_body, truth_body  whose joints are compared
/// @param frame_rate                 frames a second to compare at; none: those of the slower one
/// Throws UserError naming the track whose rate nobody knows, where fewer than two frames are left, and for a frame
/// rate above that of the slower one; DataError where the estimate has not the truth's objects, or a pose has another
/// number of joints than the body.
AlignedTracks aligned(const Track& estimate, const RestSkeleton& estimate_body, const Track& truth,
                      const RestSkeleton& truth_body, std::optional<double> frame_rate = {});

/// The poses of a track's objects at `count` moments, 1/frame_rate seconds apart from its first frame on; no bodies, no
/// cameras. Nothing where it has no objects.
std::vector<SceneState> object_states(const Track& track, double frame_rate, Index count);

/// A track without a truth, with all of its objects; as aligned.
AlignedTracks by_itself(const Track& track, const RestSkeleton& body, std::optional<double> frame_rate = {});

}  // namespace hsi4d
