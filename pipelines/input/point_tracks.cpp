#include "pipelines/input/point_tracks.h"

#include <algorithm>
#include <cmath>

#include "core/check.h"
#include "core/text.h"

namespace hsi4d {

namespace {

/// Width and height of the pictures of a file of tracks.
Vector2<double> size_in(const Npz& file, const Vector2<double>& otherwise) {
  if (!file.has("size")) return otherwise;
  const NpyArray& array = file.array("size");
  const std::vector<double> size = array.require_shape({2}).as<double>();
  for (const double side : size) {
    if (!(side > 0) || !std::isfinite(side))
      throw DataError(array.source() + ": a side of " + number_text(side) + "; allowed: above 0");
  }
  return {size[0], size[1]};
}

std::vector<double> visible_in(const Npz& file, std::int64_t frames, std::int64_t tracks) {
  if (!file.has("visible")) return std::vector<double>(static_cast<std::size_t>(frames * tracks), 1.0);
  const NpyArray& array = file.array("visible");
  std::vector<double> visible = array.require_shape({frames, tracks}).as<double>();
  for (const double v : visible) {
    if (!(v >= 0 && v <= 1)) throw DataError(array.source() + ": holds " + number_text(v) + "; allowed: 0 to 1");
  }
  return visible;
}

/// Tracks of pictures of another size lie outside of the video's.
void check_some_inside(const PointTracks& tracks, const std::string& name, const Vector2<double>& size) {
  bool is_seen = false;
  for (const std::vector<TrackPlace>& frame : tracks.frames) {
    for (const TrackPlace& place : frame) {
      if (place.visible > 0 && place.x >= 0 && place.x < 1 && place.y >= 0 && place.y < 1) return;
      is_seen = is_seen || place.visible > 0;
    }
  }
  if (!is_seen) return;
  throw DataError(name + ": no point that is seen lies in the pictures of " + number_text(size[0]) + "x" +
                  number_text(size[1]) + " pixels; are they of pictures of another size? The array \"size\" says it");
}

}  // namespace

Index PointTracks::begin(Index track) const {
  const auto is_seen = [track](const auto& frame) { return frame[static_cast<std::size_t>(track)].visible > 0; };
  return std::find_if(frames.begin(), frames.end(), is_seen) - frames.begin();
}

PointTracks decode_point_tracks(const Npz& file, Vector2<double> size) {
  const NpyArray& array = file.array("points");
  const std::vector<double> points = array.require_shape({-1, -1, 2}).as<double>();
  const std::int64_t frames = array.shape()[0], tracks = array.shape()[1];
  if (frames == 0 || tracks == 0)
    throw DataError(array.source() + ": holds " + std::to_string(tracks) + " tracks in " + std::to_string(frames) +
                    " frames; allowed: at least one");
  size = size_in(file, size);
  const std::vector<double> visible = visible_in(file, frames, tracks);
  PointTracks found;
  for (std::int64_t t = 0; t < frames; ++t) {
    std::vector<TrackPlace>& frame = found.frames.emplace_back(static_cast<std::size_t>(tracks));
    for (std::int64_t n = 0; n < tracks; ++n) {
      const auto at = static_cast<std::size_t>(t * tracks + n);
      const double x = points[2 * at] / size[0], y = points[2 * at + 1] / size[1];
      if (std::isfinite(x) && std::isfinite(y)) frame[static_cast<std::size_t>(n)] = {x, y, visible[at]};
    }
  }
  return found;
}

PointTracks read_point_tracks(const DataSettings& data, const FrameSource& frames) {
  const std::string name = data.tracks.string();
  const Npz file = Npz::read(name);
  const Image first = frames.read(0);
  const Vector2<double> video(first.width(), first.height()), size = size_in(file, video);
  const bool are_shares = size == Vector2<double>(1, 1);
  if (!are_shares && std::abs(size[0] / video[0] / (size[1] / video[1]) - 1) > 1 / video.minCoeff())
    throw DataError(name + ": is of pictures of " + number_text(size[0]) + "x" + number_text(size[1]) +
                    " pixels, the video's frames are of " + number_text(video[0]) + "x" + number_text(video[1]) +
                    "; allowed: pictures of their shape, or 1x1 for shares of the image");
  PointTracks tracks = decode_point_tracks(file, video);
  check_some_inside(tracks, name, size);
  tracks.frames = kept_frames(std::move(tracks.frames), frames, name, "frames of tracks");
  return tracks;
}

}  // namespace hsi4d
