// Video files, read and written by the program ffmpeg. Decoding in another process, as decoders end theirs on some
// damaged files.
#pragma once

#include <memory>
#include <string>

#include "core/file.h"
#include "core/image.h"
#include "core/process.h"
#include "core/video_probe.h"

namespace hsi4d {

/// A video file that is open. Frames are fast to read in order; to go back is to begin anew. Used by one thread at a
/// time.
class VideoReader {
 public:
  /// Throws UserError when the file cannot be read or ffmpeg is missing, DataError naming it when it holds no video, or
  /// one whose colours or shape would be read wrongly (probe_video).
  /// @param path  UTF-8: .mp4, .mov, .avi, .mkv, .webm, ... whatever ffmpeg reads
  explicit VideoReader(const std::string& path);

  const std::string& path() const { return path_; }
  /// As the file says; reading may show that the last ones are not there.
  Index frames() const { return facts_.frames; }
  /// Frames a second, the mean; 0 where the file does not say.
  double frame_rate() const { return facts_.frame_rate; }
  /// When each frame is shown; empty where the file does not say.
  const FrameTimes& times() const { return facts_.times; }

  /// [3,H,W], upright, 8-bit numbers v/255. Throws DataError naming file and frame when it is damaged or not there, or
  /// when others come after the last one.
  Image read(Index frame);

 private:
  void decode_next();

  std::string path_;
  VideoFacts facts_;
  std::unique_ptr<ChildProcess> decoder_;  // null: not begun
  Index next_ = 0;                         // the frame that the decoder gives next
  int width_ = 0, height_ = 0;             // of the frame before it
  Bytes pixels_;
};

/// Whether the name of a file ends like that of a video: .mp4, .mov, .avi, .mkv, .webm, .m4v, in any case.
bool is_video_name(const std::string& path);
/// These endings in words: ".mp4, .mov, ...".
std::string video_endings();

/// How many pixels share their colour in a video; brightness is each pixel's own.
enum class VideoColor {
  kShared,    ///< 4:2:0, blocks of 2x2: for any player, as generators write it
  kEachPixel  ///< 4:4:4: closer to what was rendered, not for every player
};

/// How a video is written.
struct VideoFormat {
  double frame_rate = 10;  ///< frames a second
  int quality = 18;        ///< x264's constant rate factor: 0 without loss, 18 hardly visible, 51 worst
  VideoColor color = VideoColor::kShared;
};

/// A video that comes into being when it is complete, as an AtomicFile: H.264 in MP4, 8 bit. The same bytes for the
/// same frames, on the same version of ffmpeg.
class VideoWriter {
 public:
  /// @param path  UTF-8, ending in .mp4
  /// Throws UserError when ffmpeg is missing, the ending is another, or the path cannot be written.
  VideoWriter(const std::string& path, int width, int height, const VideoFormat& format = {});

  /// Appends a frame [3,H,W], clamped to [0, 1]. Sizes that are odd get a black row or column where colours
  /// are shared.
  /// Throws UserError with ffmpeg's words when it fails, InternalError for another size.
  void add(const Image& frame);

  /// Ends the video and gives the file its name. Throws as add.
  void commit();

 private:
  int width_, height_;
  AtomicFile file_;
  ChildProcess ffmpeg_;
  Bytes frame_;
};

}  // namespace hsi4d
