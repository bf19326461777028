#include "core/video.h"

#include <cmath>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/file.h"
#include "core/image_io.h"
#include "core/linear.h"
#include "core/log.h"
#include "core/process.h"
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

/// Warnings of opening and reading a video.
struct Warnings {
  std::vector<std::string> texts;
  LogSink sink = log_to([this](LogLevel, std::string_view text) { texts.emplace_back(text); }, LogLevel::kWarning);
};

/// Another file of frames of write_frames: ffmpeg with these words between input and output.
void remake(const std::string& from, const std::vector<std::string>& words, const std::string& to) {
  std::vector<std::string> command = {"ffmpeg", "-v", "error", "-nostdin", "-y", "-i", from};
  command.insert(command.end(), words.begin(), words.end());
  command.push_back(to);
  run_process(command);
}

/// A matrix by its weights of red and blue, the range of its numbers, and what of it a file says.
struct Coding {
  double red, blue;
  bool is_full;
  std::vector<std::string> tags;
};
const Coding k709{0.2126, 0.0722, false, {}}, k601{0.299, 0.114, false, {}};

/// A video of one colour, whose numbers are computed here: two frames without loss in 4:4:4.
/// @param rgb  0 to 255
void write_color(const std::string& path, const Vector3<double>& rgb, int height, int width, const Coding& coding,
                 int bits = 8) {
  const double luma = coding.red * rgb[0] + (1 - coding.red - coding.blue) * rgb[1] + coding.blue * rgb[2];
  const double u = (rgb[2] - luma) / (2 * (1 - coding.blue)), v = (rgb[0] - luma) / (2 * (1 - coding.red));
  const double unit = bits == 10 ? 4 : 1;  // of an 8-bit number
  const auto stored = [&](double value, double offset, double range) {
    return std::lround(unit * (offset + value * (coding.is_full ? 1 : range / 255)));
  };
  const std::vector<long> numbers = {stored(luma, coding.is_full ? 0 : 16, 219), stored(u, 128, 224),
                                     stored(v, 128, 224)};
  Bytes planes;
  for (int frame = 0; frame < 2; ++frame) {
    for (const long number : numbers) {
      for (int i = 0; i < height * width; ++i) {
        planes.push_back(static_cast<uint8_t>(number & 255));
        if (bits > 8) planes.push_back(static_cast<uint8_t>(number >> 8));
      }
    }
  }
  write_file("planes.yuv", planes);
  std::vector<std::string> command = {"ffmpeg",
                                      "-v",
                                      "error",
                                      "-nostdin",
                                      "-y",
                                      "-f",
                                      "rawvideo",
                                      "-video_size",
                                      std::to_string(width) + "x" + std::to_string(height),
                                      "-pixel_format",
                                      bits > 8 ? "yuv444p10le" : "yuv444p",
                                      "-i",
                                      "planes.yuv",
                                      "-c:v",
                                      "libx264",
                                      "-qp",
                                      "0"};
  command.insert(command.end(), coding.tags.begin(), coding.tags.end());
  command.push_back(path);
  run_process(command);
}

/// The colour of a pixel, 0 to 255, is within two of this one.
void check_color(const Image& image, const Vector3<double>& rgb) {
  for (int c = 0; c < 3; ++c) CHECK(std::fabs(255 * image(c, image.height() / 2, image.width() / 2) - rgb[c]) <= 2);
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

TEST_CASE("colours are those of the matrix and range that the file names") {
  const TemporaryFolder here;
  const Vector3<double> color(200, 31, 60);
  const Warnings warnings;
  write_color("709.mp4", color, 48, 64, {0.2126, 0.0722, false, {"-colorspace", "bt709"}});
  check_color(VideoReader("709.mp4").read(1), color);
  write_color("601.mp4", color, 720, 1280, {0.299, 0.114, false, {"-colorspace", "smpte170m"}});
  check_color(VideoReader("601.mp4").read(1), color);
  write_color("full.mp4", color, 48, 64, {0.2126, 0.0722, true, {"-colorspace", "bt709", "-color_range", "pc"}});
  check_color(VideoReader("full.mp4").read(1), color);
  write_color("ten.mp4", color, 48, 64, {0.2126, 0.0722, false, {"-colorspace", "bt709"}}, 10);
  check_color(VideoReader("ten.mp4").read(1), color);
  CHECK(warnings.texts.empty());
}

TEST_CASE("a video that names no matrix has BT.709's from 720 lines or 1280 columns on") {
  const TemporaryFolder here;
  const Vector3<double> color(200, 31, 60);
  struct Case {
    int height, width;
    bool is_709;
  };
  for (const auto& [height, width, is_709] :
       {Case{720, 640, true}, {640, 1280, true}, {718, 1278, false}, {48, 64, false}}) {
    const Warnings warnings;
    write_color("a.mp4", color, height, width, is_709 ? k709 : k601);
    VideoReader video("a.mp4");
    check_color(video.read(0), color);
    check_color(video.read(1), color);
    CHECK(warnings.texts == std::vector<std::string>{
                                is_709 ? "a.mp4: does not say its colour matrix; BT.709 is assumed, as players do for "
                                         "videos from 720 lines on"
                                       : "a.mp4: does not say its colour matrix; BT.601 is assumed, as players do for "
                                         "videos below 720 lines"});
  }
}

TEST_CASE("our own videos of any size name their matrix") {
  const TemporaryFolder here;
  Image image(3, 720, 64);
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < 720; ++y) std::fill_n(image.row(c, y), 64, c == 0 ? 0.8F : 0.1F);
  }
  const Warnings warnings;
  VideoWriter video("a.mp4", 64, 720, {.quality = 1});
  for (int t = 0; t < 2; ++t) video.add(image);
  video.commit();
  check_color(VideoReader("a.mp4").read(1), {204, 25.5, 25.5});
  CHECK(warnings.texts.empty());
}

TEST_CASE("videos whose colours or shape would be read wrongly are refused") {
  const TemporaryFolder here;
  write_frames("a.mp4", 3, 48, 64);
  const auto refusal = [](const std::vector<std::string>& words, const std::string& file = "b.mp4") -> std::string {
    remake("a.mp4", words, file);
    try {
      VideoReader video(file);
    } catch (const DataError& error) {
      return error.what();
    }
    return "";
  };
  const std::string way = "; allowed are colours of BT.709 or BT.601, which ffmpeg's zscale and tonemap make";
  CHECK(refusal({"-color_trc", "smpte2084", "-color_primaries", "bt2020", "-colorspace", "bt2020nc"}) ==
        "b.mp4: has the transfer smpte2084 (PQ, HDR)" + way);
  CHECK(refusal({"-color_trc", "arib-std-b67"}) == "b.mp4: has the transfer arib-std-b67 (HLG, HDR)" + way);
  CHECK(refusal({"-color_trc", "linear"}) == "b.mp4: has the transfer linear" + way);
  CHECK(refusal({"-colorspace", "bt2020nc"}) == "b.mp4: has the colour matrix bt2020nc" + way);
  CHECK(refusal({"-colorspace", "ycgco"}) == "b.mp4: has the colour matrix ycgco" + way);
  CHECK(refusal({"-colorspace", "bt709", "-color_primaries", "bt2020"}) == "b.mp4: has the primaries bt2020" + way);
  CHECK(refusal({"-vf", "setsar=4/3"}) ==
        "b.mp4: has pixels that are not square (sample aspect ratio 4:3); ffmpeg's -vf scale=iw*sar:ih,setsar=1 makes "
        "them so");
  CHECK(refusal({"-vf", "setsar=80/79"}).empty());  // less than a pixel over all
  CHECK(refusal({"-vf", "setfield=tff", "-flags", "+ildct+ilme"}) ==
        "b.mp4: is interlaced (field order tt); allowed are whole pictures, which ffmpeg's -vf yadif makes");
  CHECK_THAT(refusal({"-vf", "format=yuva444p", "-c:v", "ffv1"}, "b.mkv"),
             StartsWith("b.mkv: has an alpha channel (yuva444p), which is not read; "));
  CHECK(refusal({"-vf", "format=yuva420p", "-c:v", "libvpx-vp9"}, "b.webm") ==
        "b.webm: has an alpha channel (alpha_mode 1), which is not read; make a video without (ffmpeg's -pix_fmt "
        "yuv444p), of masks the alpha as grey (-vf alphaextract)");
  CHECK_THAT(refusal({"-color_primaries", "smpte432"}), StartsWith("b.mp4: has the primaries smpte432; "));
  for (const char* fine : {"bt709", "smpte170m", "iec61966-2-1"}) CHECK(refusal({"-color_trc", fine}).empty());
}

TEST_CASE("a video that is to be turned is read upright") {
  const TemporaryFolder here;
  write_frames("a.mp4", 3, 48, 64, {.quality = 1});
  remake("a.mp4", {"-c", "copy", "-metadata:s:v", "rotate=90"}, "b.mp4");
  const Image flat = VideoReader("a.mp4").read(1), upright = VideoReader("b.mp4").read(1);
  REQUIRE(upright.width() == 48);
  REQUIRE(upright.height() == 64);
  double difference = 0;  // a quarter turn against the clock: the right column becomes the top row
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 48; ++x) difference += std::fabs(static_cast<double>(upright(1, y, x) - flat(1, x, 63 - y)));
  }
  CHECK(difference / (48 * 64) < 0.02);
}

TEST_CASE("a picture before the video is passed over, and of several videos the first is read") {
  const TemporaryFolder here;
  write_frames("a.mp4", 5, 48, 64);
  write_frames("b.mp4", 4, 16, 32);
  write_image("cover.png", frame_of(3, 20, 20));
  remake("cover.png", {"-i", "a.mp4", "-map", "0:v", "-map", "1:v", "-c", "copy", "-disposition:v:0", "attached_pic"},
         "track.mkv");
  remake("a.mp4", {"-attach", "cover.png", "-metadata:s:t", "mimetype=image/png", "-c", "copy"}, "attached.mkv");
  remake("cover.png", {"-i", "a.mp4", "-map", "0:v", "-map", "1:v", "-c", "copy", "-disposition:v:0", "attached_pic"},
         "cover.mp4");
  const Image frame = VideoReader("a.mp4").read(2);
  {
    const Warnings warnings;
    for (const char* name : {"track.mkv", "attached.mkv", "cover.mp4"}) {
      INFO(name);
      VideoReader video(name);
      CHECK(video.frames() == 5);
      CHECK(video.frame_rate() == 10);
      CHECK(video.read(2) == frame);
    }
    CHECK(warnings.texts.empty());
  }
  remake("a.mp4", {"-i", "b.mp4", "-map", "0:v", "-map", "1:v", "-c", "copy"}, "two.mp4");
  const Warnings warnings;
  CHECK(VideoReader("two.mp4").read(2) == frame);
  CHECK(warnings.texts == std::vector<std::string>{"two.mp4: holds 2 videos; stream 0 (64x48, 5 frames) is read, not "
                                                   "1 (32x16, 4 frames)"});
}

TEST_CASE("times are those of the time stamps") {
  const TemporaryFolder here;
  write_frames("even.mp4", 12, 16, 16, {.frame_rate = 30});
  const auto check_times = [](const std::string& path, const std::vector<double>& wanted) {
    const VideoReader video(path);
    REQUIRE(video.times().seconds.size() == wanted.size());
    for (std::size_t i = 0; i < wanted.size(); ++i) {
      INFO(path << ", frame " << i);
      CHECK(std::fabs(video.times().seconds[i] - wanted[i]) < 1.01e-3);
    }
  };
  std::vector<double> even;
  for (int i = 0; i < 12; ++i) even.push_back(i / 30.0);
  check_times("even.mp4", even);
  CHECK(VideoReader("even.mp4").frame_rate() == 30);
  remake("even.mp4", {"-c", "copy"}, "ms.mkv");  // a clock of milliseconds
  check_times("ms.mkv", even);
  CHECK(VideoReader("ms.mkv").frame_rate() == 30);
  CHECK(are_even(VideoReader("ms.mkv").times()));
  remake("even.mp4", {"-c", "copy", "-output_ts_offset", "5"}, "late.mkv");
  check_times("late.mkv", even);
  remake("even.mp4", {"-vf", "select=not(between(n\\,4\\,8))", "-fps_mode", "vfr"}, "pause.mp4");
  check_times("pause.mp4", {0, 1 / 30.0, 2 / 30.0, 3 / 30.0, 9 / 30.0, 10 / 30.0, 11 / 30.0});
  CHECK_FALSE(are_even(VideoReader("pause.mp4").times()));
}

TEST_CASE("a decoder that gives another number of frames than were counted is told") {
  const TemporaryFolder here;
  for (const auto& [frames, what] :
       {std::pair{4, "frame 4 of 6 cannot be read: ffprobe counts 6 frames, ffmpeg gives 4"},
        {8, "ffprobe counts 6 frames, ffmpeg gives more"}}) {
    write_frames("a.mp4", 6, 32, 48);
    VideoReader video("a.mp4");
    write_frames("a.mp4", frames, 32, 48);  // what the decoder then finds
    CHECK_THROWS_MATCHES(video.read(5), DataError, Message(std::string("a.mp4: ") + what));
  }
}

TEST_CASE("a frame that is read again is the same") {
  const TemporaryFolder here;
  write_frames("a.mp4", 4, 32, 48);
  VideoReader video("a.mp4");
  const Image once = video.read(2);
  CHECK(video.read(2) == once);
  CHECK(video.read(3) != once);
  CHECK(video.read(2) == once);
}

}  // namespace video_test
