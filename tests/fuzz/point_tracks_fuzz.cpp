// Any bytes as a file of point tracks, as an archive and as a list of its members.
#include "pipelines/input/point_tracks.h"
#include "tests/fuzz/archive_list.h"
#include "tests/fuzz/fuzz.h"

namespace hsi4d::fuzz::point_tracks_fuzz {

namespace {

Bytes tracks() {
  NpzWriter file;
  file.add<float>("points", {2, 2, 2}, {1, 2, 3, 4, 5, 6, 7, 8});
  file.add<std::uint8_t>("visible", {2, 2}, {1, 0, 1, 1});
  file.add<double>("size", {2}, {16, 9});
  return file.encode();
}

}  // namespace

std::vector<Bytes> corpus() { return {tracks(), list_of(tracks())}; }

bool accepts(std::span<const uint8_t> file) {
  return is_read([&] {
    const PointTracks found = decode_point_tracks(Npz::decode(archive_of(file), "fuzz.npz"), {16, 9});
    for (const std::vector<TrackPlace>& frame : found.frames)
      for (const TrackPlace& place : frame)
        HSI4D_CHECK(place.visible >= 0 && place.visible <= 1 && place.x - place.x == 0, "an accepted track");
  });
}

const Target target("point_tracks", corpus, accepts);

}  // namespace hsi4d::fuzz::point_tracks_fuzz
