#include "core/video.h"

#include <cmath>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/file.h"
#include "core/image_io.h"
#include "tests/support/temporary_folder.h"

namespace video_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
using Catch::Matchers::Message;
using Catch::Matchers::StartsWith;

namespace {

/// A smooth picture that is another in every frame.
Image frame_of(int frame, int height, int width) {
  Image image(3, height, width);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const double phase = 0.1 * x + 0.07 * y + 0.5 * frame;
      for (int c = 0; c < 3; ++c) image(c, y, x) = static_cast<float>(0.5 + 0.4 * std::sin(phase + c));
    }
  }
  return image;
}

void write_frames(const std::string& path, int frames, int height, int width, const VideoFormat& format = {}) {
  VideoWriter video(path, width, height, format);
  for (int t = 0; t < frames; ++t) video.add(frame_of(t, height, width));
  video.commit();
}

double mean_difference(const Image& a, const Image& b) {
  double sum = 0;
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < b.height(); ++y) {
      for (int x = 0; x < b.width(); ++x) sum += std::fabs(static_cast<double>(a(c, y, x) - b(c, y, x)));
    }
  }
  return sum / (3.0 * b.height() * b.width());
}

}  // namespace

TEST_CASE("a video comes back frame by frame, in any order") {
  const TemporaryFolder here;
  write_frames("a.mp4", 7, 48, 64, {.frame_rate = 12.5, .quality = 10});
  VideoReader video("a.mp4");
  CHECK(video.frames() == 7);
  CHECK(video.frame_rate() == 12.5);
  for (const int t : {0, 1, 2, 6, 3, 0, 5}) {
    const Image read = video.read(t);
    CHECK(mean_difference(read, frame_of(t, 48, 64)) < 0.02);
    CHECK(mean_difference(read, frame_of(t + 1, 48, 64)) > 0.05);
  }
}

TEST_CASE("sizes that are odd get a row and a column more") {
  const TemporaryFolder here;
  write_frames("a.mp4", 2, 31, 45);
  VideoReader video("a.mp4");
  CHECK(video.read(0).width() == 46);
  CHECK(video.read(0).height() == 32);
  CHECK(mean_difference(video.read(1), frame_of(1, 31, 45)) < 0.02);
}

TEST_CASE("the same frames give the same bytes") {
  const TemporaryFolder here;
  write_frames("a.mp4", 5, 32, 32);
  write_frames("b.mp4", 5, 32, 32);
  CHECK(read_file("a.mp4") == read_file("b.mp4"));
}

TEST_CASE("a video that is not ended leaves an older file as it was") {
  const TemporaryFolder here;
  write_frames("a.mp4", 3, 32, 32);
  const Bytes before = read_file("a.mp4");
  {
    VideoWriter video("a.mp4", 32, 32);
    video.add(frame_of(0, 32, 32));
  }
  CHECK(read_file("a.mp4") == before);
  CHECK(std::distance(std::filesystem::directory_iterator("."), {}) == 1);
}

TEST_CASE("files that are no videos, or damaged ones, are told") {
  const TemporaryFolder here;
  CHECK_THROWS_AS(VideoReader("none.mp4"), UserError);
  here.write("text.mp4", "this is no video");
  CHECK_THROWS_WITH(VideoReader("text.mp4"), StartsWith("text.mp4: is not a video that can be read: "));
  write_image("image.png", frame_of(0, 8, 8));
  CHECK_THROWS_MATCHES(VideoReader("image.png"), DataError, Message("image.png: holds one picture and no video"));
  CHECK_THROWS_MATCHES(VideoWriter("a.avi", 8, 8), UserError,
                       Message("a.avi: a video is written as .mp4, not \".avi\""));
  CHECK_THROWS_AS(VideoWriter("text.mp4/a.mp4", 8, 8), UserError);
  write_frames("whole.mp4", 20, 64, 64);
  const Bytes whole = read_file("whole.mp4");
  for (const double share : {0.2, 0.5, 0.9}) {  // an error or fewer frames, never a crash
    write_file("cut.mp4", std::span(whole).first(static_cast<std::size_t>(share * static_cast<double>(whole.size()))));
    try {
      VideoReader cut("cut.mp4");
      for (Index t = 0; t < cut.frames(); ++t) cut.read(t);
    } catch (const DataError& error) {
      CHECK_THAT(error.what(), StartsWith("cut.mp4: "));
    }
  }
}

TEST_CASE("a colour a pixel is closer to the picture than one for four, and keeps odd sizes") {
  const TemporaryFolder here;
  Image sharp(3, 33, 47);  // a chessboard of colours, each of two pixels a side
  for (int y = 0; y < 33; ++y) {
    for (int x = 0; x < 47; ++x) sharp((x / 2 + y / 2) % 3, y, x) = 0.9F;
  }
  const auto written = [&](const std::string& path, VideoColor color) {
    VideoWriter video(path, 47, 33, {.frame_rate = 10, .quality = 2, .color = color});
    for (int t = 0; t < 2; ++t) video.add(sharp);
    video.commit();
    return VideoReader(path).read(1);
  };
  const Image each = written("each.mp4", VideoColor::kEachPixel), shared = written("shared.mp4", VideoColor::kShared);
  CHECK(each.width() == 47);
  CHECK(each.height() == 33);
  CHECK(shared.width() == 48);
  CHECK(shared.height() == 34);
  CHECK(mean_difference(each, sharp) < 0.02);
  CHECK(mean_difference(shared, sharp) > 3 * mean_difference(each, sharp));
}

}  // namespace video_test
