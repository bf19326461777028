// Files of point tracks: units, what is seen, and what is refused.
#include "pipelines/input/point_tracks.h"

#include <cmath>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/image_io.h"
#include "tests/support/temporary_folder.h"

namespace point_tracks_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
namespace fs = std::filesystem;

namespace {

constexpr int kFrames = 3, kWidth = 40, kHeight = 20;

/// A folder with a video of black frames, and a file of two tracks.
struct Workshop {
  TemporaryFolder here;
  std::vector<double> points = {10, 5, 30, 15, 12, 5, 31, 15, 14, 6, 32, 15};
  std::vector<double> visible = {0, 1, 1, 0.5, 1, 0};
  std::vector<double> size;
  std::int64_t frames = kFrames;

  Workshop() {
    fs::create_directory("frames");
    for (int t = 0; t < kFrames; ++t) write_image("frames/000" + std::to_string(t) + ".png", Image(3, kHeight, kWidth));
  }
  PointTracks read() const {
    NpzWriter file;
    file.add<double>("points", {frames, std::ssize(points) / 2 / frames, 2}, points);
    if (!visible.empty()) file.add<double>("visible", {std::ssize(visible) / 2, 2}, visible);
    if (!size.empty()) file.add<double>("size", {std::ssize(size)}, size);
    file.write("tracks.npz");
    DataSettings data;
    data.tracks = "tracks.npz";
    return read_point_tracks(data, FrameSource("frames", {}));
  }
  std::string fault() const {
    try {
      read();
    } catch (const DataError& error) {
      return error.what();
    }
    return "no fault";
  }
};

}  // namespace

TEST_CASE("tracks are pixels of the video, of pictures of another size, or shares") {
  Workshop workshop;
  const auto check = [&] {
    const PointTracks tracks = workshop.read();
    REQUIRE(tracks.frames.size() == kFrames);
    REQUIRE(tracks.count() == 2);
    CHECK(tracks.frames[1][0].x == Approx(0.3));
    CHECK(tracks.frames[1][0].y == Approx(0.25));
    CHECK(tracks.frames[1][1].visible == 0.5);
    CHECK(tracks.begin(0) == 1);
    CHECK(tracks.begin(1) == 0);
  };
  check();
  workshop.size = {80, 40};
  for (double& x : workshop.points) x *= 2;
  check();
  workshop.size = {1, 1};
  for (std::size_t i = 0; i < workshop.points.size(); ++i) workshop.points[i] /= i % 2 == 0 ? 80 : 40;
  check();
}

TEST_CASE("a point that is no number is not seen, and without `visible` all others are") {
  Workshop workshop;
  workshop.visible.clear();
  workshop.points[0] = std::nan("");
  const PointTracks tracks = workshop.read();
  CHECK(tracks.frames[0][0].visible == 0);
  CHECK(tracks.frames[0][1].visible == 1);
  workshop.visible.assign(6, 0);
  CHECK(workshop.read().begin(1) == kFrames);
}

TEST_CASE("what is no file of tracks is refused by name") {
  Workshop workshop;
  workshop.visible = {0, 1, 1, 1.5, 1, 0};
  CHECK_THAT(workshop.fault(), Contains("tracks.npz: array 'visible': holds 1.5; allowed: 0 to 1"));
  workshop.visible = {0, 1};
  CHECK_THAT(workshop.fault(), Contains("array 'visible': has shape [1,2]; [3,2] is needed"));
  workshop.visible.clear();
  workshop.size = {30, 30};
  CHECK_THAT(workshop.fault(), Contains("tracks.npz: is of pictures of 30x30 pixels, the video's frames are of 40x20; "
                                        "allowed: pictures of their shape, or 1x1 for shares of the image"));
  workshop.size = {40, 0};
  CHECK_THAT(workshop.fault(), Contains("array 'size': a side of 0; allowed: above 0"));
  workshop.size.clear();
  const std::vector<double> within = workshop.points;
  for (double& x : workshop.points) x += 100;
  CHECK_THAT(workshop.fault(), Contains("tracks.npz: no point that is seen lies in the pictures of 40x20 pixels; are "
                                        "they of pictures of another size? The array \"size\" says it"));
  workshop.points = within;
  const std::vector<double> points = std::exchange(workshop.points, {});
  CHECK_THAT(workshop.fault(), Contains("array 'points': holds 0 tracks in 3 frames; allowed: at least one"));
  workshop.points = points;
  workshop.frames = 2;
  CHECK_THAT(workshop.fault(),
             Contains("tracks.npz: holds 2 frames of tracks, the video has 3 frames; allowed: that many"));
}

}  // namespace point_tracks_test
