// Tracks of points in a video, as any tracker follows them: where each point is in each frame, and whether it is seen.
#pragma once

#include <string>
#include <vector>

#include "core/npz.h"
#include "pipelines/config/data_settings.h"
#include "pipelines/input/frame_source.h"

namespace hsi4d {

/// A point in a frame. Shares of the image's width and height from the upper left corner.
struct TrackPlace {
  double x = 0, y = 0;
  double visible = 0;  ///< 0 to 1; 0: it is not seen
};

/// Tracks of a clip.
struct PointTracks {
  std::vector<std::vector<TrackPlace>> frames;  ///< by frame of the clip, then by track

  Index count() const { return frames.empty() ? 0 : std::ssize(frames.front()); }
  /// The first frame in which a track is seen; frames.size(): in none.
  Index begin(Index track) const;
};

/// The tracks of a file, of all frames that it has.
///
///   points   [T,N,2]  x, y from the upper left corner, pixels of pictures of `size`
///   visible  [T,N]    0 to 1, or booleans; without it a point is seen where its numbers are finite
///   size     [2]      width, height; [1,1]: points are shares of the image. Without it pictures are `size` of here
///
/// Throws DataError naming the file and array: other shapes, a size that is not above 0, `visible` beyond 0 to 1.
PointTracks decode_point_tracks(const Npz& file, Vector2<double> size);

/// The tracks of data.tracks. Throws UserError or DataError as Npz::read, decode_point_tracks and kept_frames, and for
/// pictures of another shape than the video's.
PointTracks read_point_tracks(const DataSettings& data, const FrameSource& frames);

}  // namespace hsi4d
