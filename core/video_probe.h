// What the program ffprobe tells of a video file, and which videos are refused for it: their pictures would be read
// with wrong colours or shapes.
#pragma once

#include <string>

#include "core/frame_times.h"

namespace hsi4d {

/// How a video is to be decoded.
struct VideoFacts {
  int stream = 0;          ///< number of the stream with the pictures
  Index frames = 0;        ///< as ffprobe decodes them, at least 2
  double frame_rate = 0;   ///< frames a second, the mean; 0: nothing says it
  FrameTimes times;        ///< empty where a frame has no time stamp
  std::string set_matrix;  ///< "bt709" or "smpte170m", as ffmpeg calls it, where the file does not say; else empty
};

/// Asks ffprobe, which decodes the whole file.
///
/// The stream is the first video that is no single picture. The rate is what the file says, or that of the time stamps
/// where these are even and the file contradicts them by half a frame at the last one. A file that does not say its
/// matrix is taken for BT.709 from 720 lines or 1280 columns on and for BT.601 below, as players do, and the log warns
/// of that; likewise of further videos that are not read.
///
/// Throws UserError when ffprobe is missing. Throws DataError naming file, value and what is allowed: no video, one
/// picture; time stamps that go back; HDR (PQ, HLG), BT.2020 and other colours than BT.709's and BT.601's; alpha;
/// pixels that are not square (by more than one over the whole picture); interlaced pictures.
VideoFacts probe_video(const std::string& path);

/// "file:" keeps names that begin like options or protocols from being taken for such.
std::string ffmpeg_input(const std::string& path);

}  // namespace hsi4d
