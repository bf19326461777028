// Video, masks and estimated motion that programs outside make, as config section `sources` says; docs/services.md is
// what they are told.
//
//   FOLDER/video-KEY.mp4         what the video's program wrote, once it was found to be right
//   FOLDER/video-KEY.mp4.json    what it was made of (pipelines/sources/record.h). KEY is the hash of this text
//   FOLDER/video-KEY.first_frame.png
//   FOLDER/person-KEY/           likewise: keypoints.json, masks/human/
//   FOLDER/person-KEY.json
//   FOLDER/masks-KEY/            likewise: human/, NAME/, or human.mp4, ...
//   FOLDER/masks-KEY.json
//   FOLDER/motion-KEY.npz        likewise
//   FOLDER/motion-KEY.npz.json
//
// What is there, made of the same, is not made again.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "core/observer.h"
#include "pipelines/config/run_config.h"
#include "pipelines/sources/record.h"

namespace hsi4d {

/// What the programs would make, in order; nothing is run.
/// Throws as video_output, person_output, mask_output and motion_output.
std::vector<SourceOutput> planned_sources(const RunConfig& config);

/// Gives what a program made its place in the inputs of a run. Masks of a person that was found have it where there are
/// none.
void take_output(const SourceOutput& output, DataSettings& data);

/// Makes the poses of the human from keypoints.
/// @param config  of the run, with all inputs but the motion
/// @param folder  to work in; is not there yet
/// @param out     the motion, .npz
using MotionMaker =
    std::function<void(const RunConfig& config, const std::filesystem::path& folder, const std::filesystem::path& out)>;

/// The inputs of a run, with the video, the person, masks and motion that programs make, made now where they are not
/// there yet.
///
/// @param make_motion  of keypoints, where sources.motion is embedded
///
/// The program's output goes to a temporary folder, is looked at (frames and their sizes, masks of the human and of
/// each object, poses of all frames), and gets its name. What is not right is kept under another name, since it may
/// have cost something. A program that fails is run again as its settings say.
///
/// Throws UserError naming the section, the program, and the end of what it printed: it cannot be run, fails, takes
/// longer than timeout_s, writes nothing; DataError for what it writes; Interrupted when asked to stop, with nothing
/// left. Throws as read_scene_setup, where the first frame is rendered.
DataSettings make_sources(const RunConfig& config, const MotionMaker& make_motion, const Observer& observer);

/// How long it is waited before a program is run again: retry_wait_s, each time twice as long, but never more than an
/// hour, or than retry_wait_s where that is more.
/// @param retry  1 before it is run for the second time
double seconds_before_retry(const ProgramSettings& settings, int retry);

/// Coverage of the human and then of each object in I_0, what hides them taken away, [1,H,W] each; as data.lens shows
/// it.
std::vector<Image> first_masks(const RunConfig& config);

/// I_0: everything in the state of frame 0, as the camera of frame 0 sees it, [3,H,W] clamped to [0, 1].  [method.md,
/// §2]
Image first_frame_image(const RunConfig& config);

}  // namespace hsi4d
