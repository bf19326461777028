#include "pipelines/scan/depth_target.h"

#include <algorithm>
#include <vector>

#include <catch2/catch.hpp>

#include "autodiff/tape.h"

namespace depth_target_test {

using namespace hsi4d;

namespace {

constexpr int kWidth = 9, kHeight = 7;

Image constant_image(float value) {
  Image image(1, kHeight, kWidth);
  for (int y = 0; y < kHeight; ++y) std::fill_n(image.row(0, y), kWidth, value);
  return image;
}

/// The slanted plane 1/z = a + b x + c y.
Photo slanted_plane() {
  Photo photo;
  photo.depth = Image(1, kHeight, kWidth);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x)
      photo.depth(0, y, x) = 1 / (0.5F + 0.05F * static_cast<float>(x) - 0.03F * static_cast<float>(y));
  }
  return photo;
}

std::vector<float> target_of(const Photo& photo) {
  std::vector<float> numbers(kWidth * kHeight, -1);
  Tape<float> tape;
  const Var<float> var = tape.constant("target", image_shape<float>(1, kHeight, kWidth));
  write_depth_target(photo, tape.write(var));
  for (int y = 0; y < kHeight; ++y) std::copy_n(tape.value(var).row(y), kWidth, numbers.begin() + y * kWidth);
  return numbers;
}

bool is_rim(int x, int y) { return x == 0 || y == 0 || x == kWidth - 1 || y == kHeight - 1; }

}  // namespace

TEST_CASE("depths of a slanted plane count up to the picture's rim") {
  const Photo photo = slanted_plane();
  const std::vector<float> target = target_of(photo);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x)
      CHECK(target[static_cast<std::size_t>(y * kWidth + x)] == (is_rim(x, y) ? 0 : photo.depth(0, y, x)));
  }
}

TEST_CASE("depths beside an edge, a hole, or of a part of a pixel do not count") {
  Photo photo = slanted_plane();
  photo.depth(0, 3, 4) *= 1.04F;  // four neighbours see it bend, and so does the pixel
  const std::vector<float> bent = target_of(photo);
  for (const auto& [x, y] : {std::pair{4, 3}, {3, 3}, {5, 3}, {4, 2}, {4, 4}})
    CHECK(bent[static_cast<std::size_t>(y * kWidth + x)] == 0);
  CHECK(bent[3 * kWidth + 2] == photo.depth(0, 3, 2));
  CHECK(bent[2 * kWidth + 3] == photo.depth(0, 2, 3));
  photo.depth(0, 3, 4) = 0;
  CHECK(target_of(photo) == bent);

  photo = slanted_plane();
  for (Image Photo::*plane : {&Photo::alpha, &Photo::weight}) {
    Photo shared = photo;
    shared.*plane = constant_image(1);
    (shared.*plane)(0, 2, 5) = 0.99F;
    std::vector<float> expected = target_of(photo);
    expected[2 * kWidth + 5] = 0;
    CHECK(target_of(shared) == expected);
  }
}

}  // namespace depth_target_test
