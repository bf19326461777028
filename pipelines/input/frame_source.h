// Where the pictures of a clip come from: a folder of images, or a video file, which both may have more frames a second
// and larger ones than the clip.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "core/check.h"
#include "core/frame_times.h"
#include "core/image.h"
#include "core/types.h"

namespace hsi4d {

/// Which frames of a video a clip keeps.
struct FrameRates {
  double video = 0;                            ///< frames a second of the video; 0: what its file says
  double kept = 0;                             ///< frames a second that are kept, the nearest ones; 0: all
  const char* video_word = "data.video_rate";  ///< what messages call them
  const char* kept_word = "data.frame_rate";
};

namespace detail {
struct OpenVideo;
}

/// Pictures of one size that follow each other. Copies share what is open. Any thread may read; a video is fast where
/// frames are read in order.
class FrameSource {
 public:
  /// Opens a video file, or lists a folder: its .png files, but for hidden ones, in the order of their names.
  ///
  /// Frame t of the clip is frame round(t · video / kept) of the video.   [method.md, §1: of 153 frames 0, 3, ..., 150]
  /// If a video's time stamps are not even and rates.video does not say that its frames are, it is the frame nearest to
  /// t / kept by them, which may be one for two; the log warns of that.
  /// Throws UserError or DataError naming the path: no such file or folder, no video, names that are no plain text or
  /// have different numbers of digits; rates without which frames cannot be chosen; uneven times of which all frames
  /// are kept, or by which there would be more than ten times as many; fewer than two frames.
  FrameSource(const std::filesystem::path& path, const FrameRates& rates);

  Index count() const { return std::ssize(names_); }
  /// Frames of the video, kept or not.
  Index video_count() const { return video_count_; }
  /// Frames a second of the video; 0: nobody says.
  double video_rate() const { return video_rate_; }
  /// Names of frames: those of the files, or "0003.png" for frame 3 of a video. Masks have the same.
  const std::vector<std::string>& names() const { return names_; }
  /// Whether a frame of the video, kept or not, has this name.
  bool has_name(const std::string& name) const;
  /// Frames a second of the clip; 0: nobody says.
  double frame_rate() const { return frame_rate_; }
  /// The one file that holds all frames; empty for a folder.
  std::filesystem::path file() const { return video_ ? path_ : std::filesystem::path(); }
  /// Number of a frame in the video; of a folder its place.
  Index number(Index frame) const { return numbers_[static_cast<std::size_t>(frame)]; }
  /// Seconds from the first frame of the video to this one; only where the rate of the video is known.
  double time(Index frame) const;
  /// When the frames of the video, kept or not, are shown: by its own time stamps, whatever data.video_rate says; of a
  /// folder by that. Empty: nobody says.
  const FrameTimes& times() const { return times_; }
  /// Which picture it is, for messages: "clip.mp4: frame 3", "frames/0003.png".
  std::string place(Index frame) const;

  /// [C,H,W]; RGB of a video. Throws as read_image and VideoReader::read; DataError for a picture that is transparent
  /// somewhere.
  Image read(Index frame) const;

 private:
  std::filesystem::path path_;
  std::shared_ptr<detail::OpenVideo> video_;  // null: a folder
  std::vector<std::string> names_;
  std::vector<Index> numbers_;
  bool is_uneven_ = false;  // chosen by the time stamps of the video
  Index video_count_ = 0;
  double video_rate_ = 0, frame_rate_ = 0;
  FrameTimes times_;
};

/// Masks of the human or of an object: a folder with images of the frames' names, of which some may be missing, or a
/// video. Its frames are those of the video's that have the same numbers, where it has as many; else the nearest in
/// time.
class MaskSource {
 public:
  /// @param folder  of the masks: NAME/ is in it, or NAME.mp4 (or another video)
  /// Throws DataError when neither is there.
  MaskSource(const std::filesystem::path& folder, const std::string& name);

  /// How many of the frames have no mask. Of a video none: it throws DataError naming the first frame that has none
  /// within half a step of the frames' video, or both numbers of frames where they differ and times are not known.
  Index missing(const FrameSource& frames) const;
  /// What the log is to tell of a video that has as many frames as the video and other times; else empty.
  std::string other_times(const FrameSource& frames) const;
  /// How many masks there are, how many of these belong to no frame of the video, kept or not, and what else a folder
  /// holds that is not read, in order.
  struct Count {
    Index all = 0, unused = 0;
    std::vector<std::string> others = {};
  };
  Count count(const FrameSource& frames) const;
  /// The folder or the video.
  const std::filesystem::path& path() const { return path_; }
  bool is_video() const { return video_ != nullptr; }
  /// The file of a frame's mask, there or not; empty for a video.
  std::filesystem::path file(const FrameSource& frames, Index frame) const;
  std::string place(const FrameSource& frames, Index frame) const;
  /// [1,H,W], as read_mask_image; an empty image where there is no mask.
  Image read(const FrameSource& frames, Index frame) const;

 private:
  bool goes_by_number(const FrameSource& frames) const;
  /// The frame of the mask video that is of a frame of the clip.
  Index number(const FrameSource& frames, Index frame) const;

  std::filesystem::path path_;
  std::shared_ptr<detail::OpenVideo> video_;  // null: a folder
};

/// Those of the video's frames that the clip keeps, of a file that has all of them, or those alone.
/// @param file     what messages call it
/// @param what     "poses"
/// @param or_else  what is allowed too: ", or ..."
/// Throws DataError for another number of them.
template <class T>
std::vector<T> kept_frames(std::vector<T> all, const FrameSource& frames, const std::string& file, const char* what,
                           const char* or_else = "") {
  if (std::ssize(all) == frames.count()) return all;
  if (std::ssize(all) != frames.video_count())
    throw DataError(
        file + ": holds " + std::to_string(all.size()) + " " + what + ", the video has " +
        std::to_string(frames.video_count()) + " frames" +
        (frames.count() == frames.video_count() ? "" : ", of which the clip keeps " + std::to_string(frames.count())) +
        "; allowed: that many" + (frames.count() == frames.video_count() ? "" : ", of either") + or_else);
  std::vector<T> some;
  for (Index t = 0; t < frames.count(); ++t) some.push_back(all[static_cast<std::size_t>(frames.number(t))]);
  return some;
}

}  // namespace hsi4d
