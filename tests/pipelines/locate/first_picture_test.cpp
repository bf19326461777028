#include "pipelines/locate/first_picture.h"

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/image_io.h"
#include "core/video.h"
#include "tests/support/temporary_folder.h"

namespace first_picture_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

constexpr int kHeight = 24, kWidth = 32;

Image plain(int channels, float value, int height = kHeight, int width = kWidth) {
  Image image(channels, height, width);
  for (int c = 0; c < channels; ++c) {
    for (int y = 0; y < height; ++y) std::fill_n(image.row(c, y), width, value);
  }
  return image;
}

/// White in columns [first, end).
Image stripe(int first, int end) {
  Image mask(1, kHeight, kWidth);
  for (int y = 0; y < kHeight; ++y) std::fill(mask.row(0, y) + first, mask.row(0, y) + end, 1.0F);
  return mask;
}

std::string columns_left(const FirstPicture& picture) {
  std::string text;
  for (int x = 0; x < kWidth; ++x) text += picture.weight(0, kHeight / 2, x) == 1 ? '1' : '0';
  return text;
}

template <class F>
std::string error_of(F call) {
  try {
    call();
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "";
}

}  // namespace

TEST_CASE("the first picture of an image, a folder and a video") {
  const TemporaryFolder folder;
  write_image("a.png", plain(3, 0.2F));
  CHECK(read_first_picture("a.png").name == "a.png");
  CHECK(read_first_picture("a.png").color(1, 3, 4) == Approx(0.2).margin(0.003));
  std::filesystem::create_directory("frames");
  write_image("frames/0004.png", plain(3, 0.4F));
  write_image("frames/0005.png", plain(3, 0.6F));
  const FirstPicture of_folder = read_first_picture("frames");
  CHECK(of_folder.name == "0004.png");
  CHECK(of_folder.place == "frames/0004.png");
  CHECK(of_folder.color(0, 0, 0) == Approx(0.4).margin(0.003));
  CHECK(of_folder.weight.empty());
  VideoWriter video("v.mp4", kWidth, kHeight);
  for (const float value : {0.8F, 0.1F}) video.add(plain(3, value));
  video.commit();
  const FirstPicture of_video = read_first_picture("v.mp4");
  CHECK(of_video.name == "0000.png");
  CHECK(of_video.color(0, 5, 5) == Approx(0.8).margin(0.03));
}

TEST_CASE("masks of all things in a folder are left out, with a margin") {
  const TemporaryFolder folder;
  write_image("0004.png", plain(3, 0.5F));
  std::filesystem::create_directories("masks/human");
  write_image("masks/human/0004.png", stripe(3, 5));
  write_image("masks/human/0005.png", stripe(20, 30));  // of another frame
  write_image("masks/can.png", stripe(10, 12));
  std::filesystem::create_directories("masks/empty");
  FirstPicture picture = read_first_picture("0004.png");
  leave_out_masks("masks", picture);
  CHECK(columns_left(picture) == "11000011100001111111111111111111");
  VideoWriter video("masks/vase.mp4", kWidth, kHeight);
  for (int i = 0; i < 2; ++i)
    video.add([&] {
      Image frame(3, kHeight, kWidth);
      for (int c = 0; c < 3; ++c)
        for (int y = 0; y < kHeight; ++y) std::fill(frame.row(c, y) + 20 - 10 * i, frame.row(c, y) + kWidth, 1.0F);
      return frame;
    }());
  video.commit();
  leave_out_masks("masks", picture);
  CHECK(columns_left(picture) == "11000011100001111110000000000000");
}

TEST_CASE("pictures and masks that are of no use are refused") {
  const TemporaryFolder folder;
  write_image("grey.png", plain(1, 0.5F));
  write_image("a.png", plain(3, 0.5F));
  CHECK_THAT(error_of([] { read_first_picture("grey.png"); }),
             Catch::Contains("grey.png: has 1 channels; allowed: colours, 3"));
  CHECK_THAT(error_of([] { read_first_picture("none.png"); }), Catch::Contains("none.png"));
  Image broken = plain(3, 0.5F);
  broken(1, 2, 3) = std::numeric_limits<float>::quiet_NaN();
  write_image("nan.exr", broken);
  CHECK_THAT(error_of([] { read_first_picture("nan.exr"); }), Catch::Contains("not finite"));
  FirstPicture picture = read_first_picture("a.png");
  CHECK(error_of([&] { leave_out_masks("masks", picture); }) == "masks: is no folder of masks");
  std::filesystem::create_directories("masks/human");
  write_image("masks/human/b.png", stripe(3, 5));
  CHECK(error_of([&] { leave_out_masks("masks", picture); }) ==
        "masks: holds no mask of a.png; allowed: THING/a.png, THING.png or THING.mp4");
  write_image("masks/human/a.png", plain(1, 1.0F, kHeight, kWidth + 1));
  CHECK_THAT(error_of([&] { leave_out_masks("masks", picture); }),
             Catch::Contains("its mask is 33x24 pixels, the frame 32x24"));
  write_image("masks/human/a.png", plain(1, 1.0F));
  CHECK_THAT(error_of([&] { leave_out_masks("masks", picture); }), Catch::Contains("cover all of a.png"));
}

}  // namespace first_picture_test
