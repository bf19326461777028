#include "pipelines/input/frame_source.h"

#include <cmath>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/image_io.h"
#include "core/log.h"
#include "core/process.h"
#include "core/text.h"
#include "core/video.h"
#include "pipelines/input/clip.h"
#include "tests/support/palette_png.h"
#include "tests/support/png_chunk.h"
#include "tests/support/tiny_run.h"

namespace frame_source_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Message;
namespace fs = std::filesystem;

namespace {

/// An image of one colour, by which it is known again.
Image numbered(int number, int height = 16, int width = 24) {
  Image image(3, height, width);
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < height; ++y) std::fill_n(image.row(c, y), width, static_cast<float>(number) / 50);
  }
  return image;
}

int number_of(const Image& image) { return static_cast<int>(std::lround(50 * image(1, 3, 3))); }

void write_numbered_video(const std::string& path, int frames, double rate) {
  VideoWriter video(path, 24, 16, {.frame_rate = rate, .quality = 1});
  for (int t = 0; t < frames; ++t) video.add(numbered(t));
  video.commit();
}

void write_numbered_folder(const std::string& folder, int frames) {
  fs::create_directories(folder);
  for (int t = 0; t < frames; ++t) write_image(folder + "/" + four_digits(t) + ".png", numbered(t));
}

std::vector<int> numbers_of(const FrameSource& source) {
  std::vector<int> numbers;
  for (Index t = 0; t < source.count(); ++t) numbers.push_back(number_of(source.read(t)));
  return numbers;
}

}  // namespace

TEST_CASE("a video and a folder of its frames give the same clip") {
  const TemporaryFolder here;
  write_numbered_video("a.mp4", 16, 30);
  write_numbered_folder("a", 16);
  const FrameSource video("a.mp4", {0, 10}), folder("a", {30, 10});
  CHECK(numbers_of(video) == std::vector<int>{0, 3, 6, 9, 12, 15});
  CHECK(numbers_of(folder) == numbers_of(video));
  CHECK(video.names() == folder.names());
  CHECK(video.names()[2] == "0006.png");
  CHECK(video.frame_rate() == 10);
  CHECK(folder.frame_rate() == 10);
  CHECK(video.place(1) == "a.mp4: frame 3");
  CHECK(folder.place(1) == "a/0003.png");
  CHECK(number_of(video.read(1)) == 3);  // back again
}

TEST_CASE("frames are the nearest to the rate that is kept, or all") {
  const TemporaryFolder here;
  write_numbered_folder("a", 13);
  CHECK(numbers_of(FrameSource("a", {25, 10})) == std::vector<int>{0, 3, 5, 8, 10});  // 2.5 and 7.5 up; 12.5 is beyond
  CHECK(FrameSource("a", {}).count() == 13);
  CHECK(FrameSource("a", {}).frame_rate() == 0);
  CHECK(FrameSource("a", {12, 12}).count() == 13);
}

TEST_CASE("of a video of 153 frames the paper's setting keeps 51: 0, 3, ..., 150") {
  const RunConfig config =
      load_run_config(fs::path(HSI4D_SOURCE_DIR) / "configs/sources/kling.json", {}, descriptions_of(loss_terms()));
  const TemporaryFolder here;
  write_numbered_folder("a", static_cast<int>(config.sources.video.frames));
  const FrameSource frames("a", {config.data.video_rate, config.data.frame_rate});
  CHECK(frames.video_count() == 153);
  REQUIRE(frames.count() == 51);
  for (Index t = 0; t < 51; ++t) {
    CHECK(frames.number(t) == 3 * t);
    CHECK(frames.names()[static_cast<std::size_t>(t)] == four_digits(static_cast<int>(3 * t)) + ".png");
  }
  CHECK(frames.names().back() == "0150.png");
}

TEST_CASE("rates that cannot be kept are told") {
  const TemporaryFolder here;
  write_numbered_folder("a", 5);
  write_numbered_video("a.mp4", 5, 30);
  CHECK_THROWS_MATCHES(FrameSource("a", {0, 10}), UserError,
                       Message("a: does not say how many frames a second it has, so that 10 of them cannot be kept; "
                               "data.video_rate says it"));
  CHECK_THROWS_MATCHES(FrameSource("a.mp4", {0, 60}), UserError,
                       Message("a.mp4: has 30 frames a second; data.frame_rate, 60, cannot be more"));
  CHECK_THROWS_MATCHES(FrameSource("a.mp4", {0, 1}), UserError,
                       Message("a.mp4: gives 1 of its 5 frames; a clip needs at least 2"));
}

TEST_CASE("frames of a video with pauses are chosen by their times") {
  const TemporaryFolder here;
  write_numbered_video("even.mp4", 44, 30);
  // Frames 0-3, 10-13, 20-31 and 40-43 of 30 a second.
  run_process({"ffmpeg", "-v", "error", "-nostdin", "-i", "even.mp4", "-vf",
               "select=between(n\\,0\\,3)+between(n\\,10\\,13)+between(n\\,20\\,31)+between(n\\,40\\,43)", "-fps_mode",
               "vfr", "-crf", "1", "a.mp4"});
  const std::string gap =
      "a.mp4: its frames follow each other after 0.03333 s, but frame 20 comes 0.3 s after frame 19";
  CHECK_THROWS_MATCHES(
      FrameSource("a.mp4", {}), UserError,
      Message(gap + "; set data.frame_rate, for which the nearest ones in time are taken, or data.video_rate, if they "
                    "are equally far apart in truth"));
  CHECK_THROWS_MATCHES(FrameSource("a.mp4", {0, 40}), UserError,
                       Message("a.mp4: has 30 frames a second; data.frame_rate, 40, cannot be more"));
  std::vector<std::string> told;
  const LogSink sink = log_to([&](LogLevel, std::string_view text) { told.emplace_back(text); }, LogLevel::kWarning);
  const FrameSource frames("a.mp4", {0, 10});
  CHECK(told == std::vector<std::string>{gap + "; the nearest in time are taken, one ahead of it again for 2 of 15"});
  // The nearest to 0, 3, 6, ... 42 of those that are there.
  CHECK(numbers_of(frames) == std::vector<int>{0, 3, 3, 10, 12, 13, 20, 21, 24, 27, 30, 31, 40, 40, 42});
  CHECK(frames.names()[3] == "0004.png");
  CHECK(frames.frame_rate() == 10);
  CHECK(frames.video_count() == 24);
  CHECK(frames.time(3) == Approx(10 / 30.0));
  std::vector<Index> all(24);
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = static_cast<Index>(i);
  CHECK(kept_frames(all, frames, "a.npz", "poses") ==
        std::vector<Index>{0, 3, 3, 4, 6, 7, 8, 9, 12, 15, 18, 19, 20, 20, 22});
  // Its rate is known better: a slow film.
  const FrameSource counted("a.mp4", {120, 60});
  CHECK(counted.count() == 12);
  CHECK(counted.number(11) == 22);
  CHECK(counted.time(11) == Approx(22 / 120.0));
}

TEST_CASE("a time stamp that would make a frame into many is refused") {
  const TemporaryFolder here;
  write_numbered_video("even.mp4", 8, 30);
  const auto with_last_at = [](const std::string& second) {
    run_process({"ffmpeg", "-v", "error", "-nostdin", "-y", "-i", "even.mp4", "-vf",
                 "setpts=if(eq(N\\,7)\\," + second + "/TB\\,PTS)", "-fps_mode", "passthrough", "-crf", "1", "a.mkv"});
    return FrameSource("a.mkv", {0, 10}).count();
  };
  CHECK(with_last_at("7.8") == 79);
  CHECK_THROWS_MATCHES(
      with_last_at("400000"), DataError,
      Message(
          "a.mkv: its frames follow each other after 0.033 s, but frame 7 comes 400000 s after frame 6, so that 10 a "
          "second would make 4000000 of its 8; allowed: at most 80. Cut the video there, or set data.video_rate if "
          "its frames are equally far apart in truth"));
}

TEST_CASE("a wide profile of frames is warned of once") {
  const TemporaryFolder here;
  write_numbered_folder("a", 3);
  for (const char* name : {"a/0000.png", "a/0001.png"})
    write_file(name, with_png_chunk(read_file(name), "iCCP", std::string_view("Display P3\0\0x", 13)));
  std::vector<std::string> told;
  const LogSink sink = log_to([&](LogLevel, std::string_view text) { told.emplace_back(text); }, LogLevel::kWarning);
  const FrameSource frames("a", {});
  CHECK(told == std::vector<std::string>{"a/0000.png: has the colour profile \"Display P3\", which is passed over: "
                                         "colours are taken for sRGB's"});
}

TEST_CASE("hidden files are no frames and no masks") {
  const TemporaryFolder here;
  write_numbered_folder("a", 3);
  write_numbered_folder("masks/human", 3);
  for (const char* name : {"a/.0001.png", "a/._0002.png", "masks/human/._0000.png", "masks/._human.mp4"})
    here.write(name, "no picture");
  const FrameSource frames("a", {});
  CHECK(frames.names() == std::vector<std::string>{"0000.png", "0001.png", "0002.png"});
  const MaskSource masks("masks", "human");
  CHECK(masks.count(frames).all == 3);
  CHECK(masks.count(frames).unused == 0);
}

TEST_CASE("masks of a folder and of a video are read as masks, not as their first channel") {
  const TemporaryFolder here;
  write_numbered_folder("a", 2);
  const FrameSource frames("a", {});
  Bytes indices(16 * 24, 0);
  indices[3 * 24 + 5] = 1;
  fs::create_directories("masks/human");
  write_file("masks/human/0000.png", palette_png(24, 16, indices, {{0, 0, 0, 255}, {128, 0, 0, 255}}));
  const Image mask = MaskSource("masks", "human").read(frames, 0);
  CHECK(mask.channels() == 1);
  CHECK(mask(0, 3, 5) == 1);
  CHECK(mask(0, 3, 6) == 0);
  Image blue(3, 16, 24);
  for (int y = 4; y < 12; ++y) std::fill_n(blue.row(2, y) + 6, 12, 1.0F);
  VideoWriter video("masks/can.mp4", 24, 16, {.quality = 1});
  for (int t = 0; t < 2; ++t) video.add(blue);
  video.commit();
  CHECK_THROWS_WITH(MaskSource("masks", "can").read(frames, 1),
                    Catch::Matchers::StartsWith("masks/can.mp4: frame 1: is a colour mask: row "));
}

TEST_CASE("masks are a folder or a video of the human or the object") {
  const TemporaryFolder here;
  write_numbered_video("a.mp4", 12, 30);
  const FrameSource frames("a.mp4", {0, 10});
  write_numbered_folder("masks/human", 12);
  fs::remove("masks/human/0006.png");
  write_numbered_video("masks/can.mp4", 10, 30);
  write_numbered_video("masks/short.mp4", 9, 30);
  const MaskSource human("masks", "human"), can("masks", "can");
  CHECK(human.missing(frames) == 1);
  CHECK(human.read(frames, 2).width() == 0);
  CHECK(human.read(frames, 1).channels() == 1);
  CHECK(can.missing(frames) == 0);
  CHECK(can.is_video());
  for (const Index t : {0, 1, 3})
    CHECK(std::lround(50 * can.read(frames, t)(0, 3, 3)) == std::lround(50 * frames.read(t)(0, 3, 3)));
  CHECK_THROWS_MATCHES(MaskSource("masks", "short").missing(frames), DataError,
                       Message("masks/short.mp4: has no mask for the video's frame 9 at 0.3 s; the nearest is its "
                               "frame 8 at 0.2667 s, allowed: within 0.01667 s, or as many frames as the video, 12"));
  CHECK_THROWS_MATCHES(MaskSource("masks", "cup"), DataError,
                       Message("masks/cup: there is no such folder of masks, nor a video \"cup.mp4\""));
}

TEST_CASE("masks of a video of another length are the nearest in time") {
  const TemporaryFolder here;
  fs::create_directories("masks");
  write_numbered_video("a.mp4", 12, 30);
  const FrameSource frames("a.mp4", {0, 10});
  const auto numbers = [&frames](const MaskSource& masks) {
    std::vector<Index> all;
    for (Index t = 0; t < frames.count(); ++t) all.push_back(std::lround(50 * masks.read(frames, t)(0, 3, 3)));
    return all;
  };
  write_numbered_video("masks/fast.mp4", 30, 60);
  const MaskSource fast("masks", "fast");
  CHECK(fast.missing(frames) == 0);
  CHECK(numbers(fast) == std::vector<Index>{0, 6, 12, 18});
  CHECK(fast.place(frames, 1) == "masks/fast.mp4: frame 6");
  CHECK(fast.count(frames).unused == 18);
  write_numbered_video("masks/kept.mp4", 4, 10);  // of the clip's frames alone
  const MaskSource kept("masks", "kept");
  CHECK(kept.missing(frames) == 0);
  CHECK(numbers(kept) == std::vector<Index>{0, 1, 2, 3});
  CHECK(kept.count(frames).unused == 0);
  write_numbered_video("masks/other.mp4", 13, 25);
  CHECK_THROWS_MATCHES(MaskSource("masks", "other").missing(frames), DataError,
                       Message("masks/other.mp4: has no mask for the video's frame 3 at 0.1 s; the nearest is its "
                               "frame 3 at 0.12 s, allowed: within 0.01667 s, or as many frames as the video, 12"));
  write_numbered_video("masks/equal.mp4", 12, 10);  // by number, which is told
  const MaskSource equal("masks", "equal");
  CHECK(equal.missing(frames) == 0);
  CHECK(numbers(equal) == std::vector<Index>{0, 3, 6, 9});
  CHECK(equal.other_times(frames) ==
        "masks/equal.mp4: its frame 1 at 0.1 s is taken for the video's frame 1 at 0.03333 s, as both have 12 frames");
  CHECK(fast.other_times(frames).empty());
  write_numbered_folder("timeless", 12);
  CHECK_THROWS_MATCHES(fast.missing(FrameSource("timeless", {})), DataError,
                       Message("masks/fast.mp4: has 30 frames, the video has 12; allowed: as many, as times by which "
                               "masks could be found are not known of both"));
}

TEST_CASE("a clip of videos at twice the size is that of its images, nearly") {
  const CopiedDataset dataset;
  const DataSettings images = dataset_inputs(dataset.path);
  const Clip of_images = read_clip(images);
  const auto doubled = [](const Image& image) {
    return resize_area(image, 2 * image.height(), 2 * image.width());  // an enlargement repeats pixels
  };
  const auto write_video = [&](const fs::path& path, const auto& image_of) {
    VideoWriter video(path.string(), 2 * kTinyPixels, 2 * kTinyPixels, {.frame_rate = 10, .quality = 1});
    for (Index t = 0; t < of_images.frames(); ++t) {
      const Image image = doubled(image_of(read_frame(of_images, t)));
      Image rgb(3, image.height(), image.width());
      for (int c = 0; c < 3; ++c) {
        for (int y = 0; y < image.height(); ++y)
          std::copy_n(image.row(image.channels() == 3 ? c : 0, y), image.width(), rgb.row(c, y));
      }
      video.add(rgb);
    }
    video.commit();
  };
  write_video(dataset.path / "video.mp4", [](const ClipFrame& frame) { return frame.target; });
  const fs::path masks = dataset.path / "video_masks";
  fs::create_directories(masks);
  write_video(masks / "human.mp4", [](const ClipFrame& frame) { return frame.human_mask; });
  write_video(masks / (std::string(kTinyObject) + ".mp4"),
              [](const ClipFrame& frame) { return frame.object_masks[0]; });
  DataSettings data = images;
  data.frames = dataset.path / "video.mp4";
  data.masks = masks;
  const Clip clip = read_clip(data);
  REQUIRE(clip.frames() == of_images.frames());
  CHECK(frame_files(data, clip, 1).empty());
  CHECK(clip.files.size() == of_images.files.size() + 3);
  check_frames(data, clip, {});
  for (Index t = 0; t < clip.frames(); ++t) {
    const ClipFrame a = read_frame(of_images, t), b = read_frame(clip, t);
    double sum = 0;
    for (int y = 0; y < kTinyPixels; ++y) {
      for (int x = 0; x < kTinyPixels; ++x) {
        sum +=
            std::fabs(a.target(1, y, x) - b.target(1, y, x)) + std::fabs(a.human_mask(0, y, x) - b.human_mask(0, y, x));
      }
    }
    CHECK(sum / (kTinyPixels * kTinyPixels) < 0.05);
  }
}

TEST_CASE("frames smaller than the camera's image, or of another shape, are refused") {
  const CopiedDataset dataset;
  const DataSettings data = dataset_inputs(dataset.path);
  for (const auto& [height, width] : {std::pair{kTinyPixels / 2, kTinyPixels / 2}, {2 * kTinyPixels, kTinyPixels}}) {
    write_image((dataset.path / "frames/0002.png").string(), Image(3, height, width));
    const Clip clip = read_clip(data);
    CHECK_THROWS_AS(read_frame(clip, 2), DataError);
  }
}

}  // namespace frame_source_test
