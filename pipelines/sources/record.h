// What the outputs of programs outside (pipelines/sources/sources.h) are made of, and by that what they are called.
//
// A record is JSON:
//
//   command      as the config has it, placeholders and all
//   files        "HASH NAME" a line: the program, where it is named by its path, and files that arguments name
//   prompt       where the command has {prompt}
//   seed         where the command has {seed}
//   first_frame  where it has {first_frame} (or first_masks): content of scene, objects, avatar, camera and initial
//                state, background and render settings
//   video        of person, masks and motion: its content
//   masks_of, camera, video_rate
//
// Of masks that this program makes itself (pipelines/follow) it has, beside the video and masks_of:
//
//   method       kFollowMethod: other ones make other masks
//   human        content of the human's masks, where they are given
//   first        what is known of objects in frame 0; first_frame where some first mask is rendered
//   frame_rate, video_rate
//
// Of a motion that this program makes itself:
//
//   method       kKeypointMotionMethod: other ones make other motions
//   keypoints    content of the keypoints, and of the file that says which joints they stand for
//   first_frame, frame_rate, video_rate
//   finds_first  whether frame 0 is found of keypoints too
//
// KEY in a name is the record's hash.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "pipelines/config/run_config.h"
#include "pipelines/input/frame_source.h"

namespace hsi4d {

/// How a motion is made of keypoints (pipelines/run/keypoint_motion.h); to be counted up where motions become others.
inline constexpr int kKeypointMotionMethod = 1;

/// What finds a person writes into its folder, beside masks/human.
inline constexpr const char* kPersonKeypoints = "keypoints.json";
inline constexpr const char* kPersonMasks = "masks";

/// One thing that a program makes.
struct SourceOutput {
  std::string what;                  ///< "video", "person", "masks" or "motion"
  std::vector<std::string> command;  ///< as in the config; empty: this program makes it
  std::filesystem::path path;        ///< where it is, or will be; empty: not known before the video is there
  std::string record;                ///< what it is made of, JSON
  bool is_there = false;             ///< made before, of the same
};

/// The files that say in their content what a command does, as it names them: its program, where that has a '/', and
/// each argument without placeholders, or what follows the first '=' in it, that is a file. Folders are no files.
std::vector<std::string> files_of_command(const std::vector<std::string>& command);

/// "HASH NAME" of a line each. Of a file beyond 64 MiB the hash is that of its size and of the 4 MiB at either end.
/// Throws UserError naming a file that cannot be read.
std::string command_hashes(const std::vector<std::string>& command);

/// What the programs of a config make. A video that is there has the frames that sources.video.frames asks for, masks
/// that are there are those of every frame that is kept.
/// @param data  with the video; of embedded ones with what finds the person has made, too
/// Throws UserError or DataError naming an input that is missing; UserError with its place in the config for an output
/// that is there and does not hold what is asked for now.
SourceOutput video_output(const RunConfig& config);
SourceOutput person_output(const RunConfig& config, const DataSettings& data);
SourceOutput mask_output(const RunConfig& config, const DataSettings& data);
SourceOutput embedded_mask_output(const RunConfig& config, const DataSettings& data);
SourceOutput motion_output(const RunConfig& config, const DataSettings& data);
SourceOutput embedded_motion_output(const RunConfig& config, const DataSettings& data);

/// Where an output's record is kept.
std::filesystem::path record_file(const SourceOutput& output);

/// ".mp4"; empty for a folder of frames.
std::string ending_of(VideoOutput output);

/// Whether frame 0 is not exact: a stage over it moves the human.
bool finds_first_frame(const RunConfig& config);

/// What has masks: the human, then the objects by name.
std::vector<std::string> masked_names(const DataSettings& data);

/// The video of a run, at its rates.
FrameSource frames_of(const DataSettings& data);

/// Throws DataError where some frame that is kept has no mask of `name`; what hides something wholly is a black mask.
void check_has_all(const MaskSource& masks, const FrameSource& frames, const std::string& name);

}  // namespace hsi4d
