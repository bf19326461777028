// The masks of a video's objects as files, in the form that data.masks has.
//
//   FOLDER/NAME/0000.png    the mask of an object in a frame, by the frame's name
//   FOLDER/human/0000.png   the human's, as they were given
//   FOLDER/scores.json      {"NAME": {"states": ["seen", ...], "scores": [1, ...]}}
//   FOLDER/followed.jpg     frames with what was found: green is seen, yellow doubtful; a red border: an object is not
//                           found
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/observer.h"
#include "pipelines/follow/first_mask.h"
#include "pipelines/follow/object_follower.h"
#include "pipelines/input/frame_source.h"

namespace hsi4d {

/// Of the pictures that are looked at.
inline constexpr int kFollowSide = 512;

/// Counts changes of the method after which it makes other masks.
inline constexpr int kFollowMethod = 1;

/// The picture of what was found.
inline constexpr const char* kSheetFile = "followed.jpg";

/// An object, and its mask in the first frame.
struct ObjectToFollow {
  std::string name;
  Image mask;  ///< [1,H,W]
};

/// What became of an object, by frame; of the first it is given.
struct FollowedTrack {
  std::string name;
  std::vector<Followed> states;
  std::vector<double> scores;  ///< 0 to 1
};

/// Follows objects through a video and writes their masks.
///
/// @param human    masks of the human, copied and used (ObjectFollower); none: not known
/// @param objects  at least one; masks of the frames' size
/// @param path_of  where a file is written: "can/0003.png"
/// Throws as FrameSource::read, MaskSource::read and write_image; DataError where frames or masks differ in size;
/// Interrupted.
std::vector<FollowedTrack> follow_objects(const FrameSource& frames, const std::optional<MaskSource>& human,
                                          const std::vector<ObjectToFollow>& objects, int longest_side_px,
                                          const std::function<std::string(const std::filesystem::path&)>& path_of,
                                          const Observer& observer);

/// "can: seen in 50 of 51 frames, score 0.93 on average, least 0.71 in frame 12; not found in frames 30-34; doubtful in
/// frame 35".
std::string track_text(const FollowedTrack& track, const FrameSource& frames);

/// Whether it is seen without doubt in all frames.
bool is_whole(const FollowedTrack& track);

/// A frame as [3,H,W]: without its alpha, or its grey three times.
Image read_rgb(const FrameSource& frames, Index frame);

/// The human's mask in a frame, black where there is none; empty without a source.
Image human_mask(const std::optional<MaskSource>& human, const FrameSource& frames, Index frame);

}  // namespace hsi4d
