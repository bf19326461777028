#include "pipelines/draw/report_images.h"

#include <cstdio>
#include <filesystem>

#include <catch2/catch.hpp>

#include "core/image_io.h"
#include "core/random.h"
#include "tests/support/temporary_folder.h"

namespace report_images_test {

using namespace hsi4d;
using namespace hsi4d::test;
namespace fs = std::filesystem;

namespace {

/// A picture with large shapes and some noise.
Image picture(int width, int height, std::uint64_t seed) {
  Image image(3, height, width);
  RandomSequence random(seed);
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x)
        image(c, y, x) = (x > width / 2 ? 0.7F : 0.2F) + static_cast<float>(random.uniform(-0.1, 0.1));
    }
  }
  return image;
}

/// frames/ with every kind of image of frames 0 to `count` − 1, and a difference, which no report takes.
void write_frames(int count, int width, int height) {
  fs::create_directories("frames");
  for (int f = 0; f < count; ++f) {
    for (const char* kind : {"target", "render", "start", "side", "difference"}) {
      char name[64];
      std::snprintf(name, sizeof name, "frames/%04d_%s.png", f, kind);
      write_image(name, picture(width, height, static_cast<std::uint64_t>(f)));
    }
  }
}

size_t bytes_of(const std::vector<FrameImages>& frames) {
  size_t bytes = 0;
  for (const FrameImages& frame : frames) {
    for (const Bytes& file : frame.files) bytes += file.size();
  }
  return bytes;
}

}  // namespace

TEST_CASE("a report takes images as they are while they are small") {
  const TemporaryFolder here;
  write_frames(2, 40, 30);
  std::vector<std::string> notes;
  const std::vector<FrameImages> frames = read_frame_images("frames", notes);
  CHECK(notes.empty());
  REQUIRE(frames.size() == 2);
  CHECK(frames[1].frame == 1);
  CHECK(frames[1].files[1] == read_file("frames/0001_render.png"));
  CHECK(frames[1].files[3] == read_file("frames/0001_side.png"));
}

TEST_CASE("images of a report are packed until they fit, the compared ones best") {
  const TemporaryFolder here;
  write_frames(3, 400, 300);
  std::vector<std::string> notes;
  const size_t as_png = bytes_of(read_frame_images("frames", notes));
  const ImageBudget half{.wanted = as_png / 2}, tenth{.wanted = as_png / 10}, least{.wanted = 1};
  size_t before = as_png;
  for (const ImageBudget& budget : {half, tenth, least}) {
    const std::vector<FrameImages> frames = read_frame_images("frames", notes, budget);
    REQUIRE(frames.size() == 3);
    const size_t bytes = bytes_of(frames);
    INFO(budget.wanted << " bytes are wanted, " << bytes << " are there, " << as_png << " of PNG");
    CHECK(bytes < before);
    if (budget.wanted > 1) CHECK(bytes < budget.wanted * 11 / 10);
    before = bytes;
    for (const Bytes& file : frames[2].files) CHECK(image_mime(file) == "image/jpeg");
  }
  const std::vector<FrameImages> smallest = read_frame_images("frames", notes, least);
  const Image render = decode_image(smallest[1].files[1], "render.jpg"),
              side = decode_image(smallest[1].files[3], "side.jpg");
  CHECK(render.width() == 300);
  CHECK(render.height() == 225);
  CHECK(side.width() == 200);
  CHECK(std::abs(render(0, 100, 40) - 0.2F) < 0.15F);
  CHECK(std::abs(render(0, 100, 260) - 0.7F) < 0.15F);
  CHECK(notes.empty());
}

TEST_CASE("frames of a report are left out when nothing else makes it small enough") {
  const TemporaryFolder here;
  write_frames(7, 64, 48);
  std::vector<std::string> notes;
  const size_t bytes = bytes_of(read_frame_images("frames", notes, {.wanted = 1}));
  const std::vector<FrameImages> frames = read_frame_images("frames", notes, {.wanted = 1, .most = bytes * 2 / 5});
  CHECK(notes == std::vector<std::string>{"Of 7 frames with images every 3th is shown, to keep this file small."});
  REQUIRE(frames.size() == 3);
  CHECK(frames[2].frame == 6);
}

TEST_CASE("what is no image, or missing, is told") {
  const TemporaryFolder here;
  write_frames(3, 40, 30);
  here.write("frames/0001_target.png", "text");
  here.write("frames/notes.txt", "text");
  fs::remove("frames/0002_render.png");
  fs::remove("frames/0002_side.png");  // not every run has it
  const std::vector<std::string> expected = {"frames/0001_target.png is not a PNG image.",
                                             "Of 3 frames 1 have no image of the kind \"render\"."};
  for (const size_t wanted : {size_t{1}, size_t{1} << 30U}) {
    std::vector<std::string> notes;
    const std::vector<FrameImages> frames = read_frame_images("frames", notes, {.wanted = wanted});
    CHECK(notes == expected);
    CHECK(frames[1].files[0].empty());
    CHECK(frames[2].files[1].empty());
  }
  const std::string whole = file_text("frames/0000_start.png");
  here.write("frames/0000_start.png", whole.substr(0, whole.size() / 2));  // cut short: seen only where it is decoded
  std::vector<std::string> notes;
  CHECK(read_frame_images("frames", notes, {.wanted = 1})[0].files[2].empty());
  CHECK(notes.size() == 3);
  std::vector<std::string> none;
  CHECK(read_frame_images("nowhere", none).empty());
  CHECK(none == std::vector<std::string>{"There are no images in frames/."});
}

}  // namespace report_images_test
