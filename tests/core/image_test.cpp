#include "core/image.h"

#include <bit>
#include <numeric>

#include <catch2/catch.hpp>

#include "core/check.h"

namespace image_test {

using namespace hsi4d;

namespace {

/// Different numbers everywhere.
Image counting(int channels, int height, int width) {
  Image image(channels, height, width);
  for (int c = 0; c < channels; ++c) {
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) image(c, y, x) = static_cast<float>(10000 * c + 100 * y + x + 1);
    }
  }
  return image;
}

double mean(const Image& image) {
  const std::vector<float> values = to_interleaved(image);
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

bool padding_is_zero(const Image& image) {
  for (int c = 0; c < image.channels(); ++c) {
    for (int y = 0; y < image.height(); ++y) {
      for (int64_t x = image.width(); x < image.row_stride(); ++x) {
        if (image.row(c, y)[x] != 0) return false;
      }
    }
  }
  return true;
}

template <class S>
void check_rows(int64_t most) {
  for (int64_t width = 0; width <= most; ++width) {
    const int64_t bytes = padded_row<S>(width) * static_cast<int64_t>(sizeof(S));
    const bool fits = padded_row<S>(width) >= width && bytes % 64 == 0;
    const bool spreads = bytes < 1024 || (bytes % 1024 != 0 && !std::has_single_bit(static_cast<uint64_t>(bytes)));
    const bool tight = bytes - width * static_cast<int64_t>(sizeof(S)) < 128;
    if (!(fits && spreads && tight)) FAIL("width " << width << " gives " << bytes << " bytes");
  }
}

}  // namespace

static_assert(padded_row<float>(0) == 0 && padded_row<float>(1) == 16 && padded_row<float>(16) == 16);
static_assert(padded_row<float>(256) == 272 && padded_row<double>(128) == 136 && padded_row<float>(255) == 272);
static_assert(padded_row<float>(1920) == 1920 && padded_row<float>(1280) == 1296 && padded_row<uint8_t>(65) == 128);

TEST_CASE("padded rows are whole cache lines, never a multiple of 1024 bytes, and at most two lines longer") {
  check_rows<uint8_t>(9000);
  check_rows<float>(9000);
  check_rows<double>(9000);
}

TEST_CASE("an image is aligned, zero and planar") {
  Image image(3, 5, 256);
  CHECK(image.row_stride() == 272);
  CHECK(image.plane_stride() == 5 * 272);
  CHECK(image.data().size() == 3 * 5 * 272);
  for (const float value : image.data()) REQUIRE(value == 0);
  for (int y = 0; y < 5; ++y) CHECK(reinterpret_cast<uintptr_t>(image.row(2, y)) % 64 == 0);
  image(1, 2, 3) = 7;
  CHECK(image.data()[1 * 5 * 272 + 2 * 272 + 3] == 7);
  CHECK(Image().empty());
  CHECK(Image(3, 0, 7).empty());
  CHECK_THROWS_WITH(Image(3, -1, 7), Catch::Contains("3 channels of 7 x -1 pixels"));
  CHECK_THROWS_AS(Image(1 << 30, 1 << 30, 1 << 30), InternalError);
}

TEST_CASE("interleaved and planar agree") {
  const Image image = counting(3, 4, 19);
  const std::vector<float> values = to_interleaved(image);
  REQUIRE(values.size() == 3 * 4 * 19);
  CHECK(values[(2 * 19 + 5) * 3 + 1] == image(1, 2, 5));
  const Image back = from_interleaved(values, 4, 19, 3);
  CHECK(back == image);
  CHECK(padding_is_zero(back));
  CHECK_THROWS_WITH(from_interleaved(values, 4, 19, 4), Catch::Contains("(228 against 304)"));
}

TEST_CASE("channels and parts are taken out") {
  const Image image = counting(4, 6, 33);
  const Image colour = take_channels(image, 1, 2);
  CHECK(colour.channels() == 2);
  CHECK(colour(0, 5, 32) == image(1, 5, 32));
  CHECK(colour(1, 0, 0) == image(2, 0, 0));
  CHECK_THROWS_WITH(take_channels(image, 2, 3), Catch::Contains("3 channels from 2 of 4"));

  const Image part = crop(image, 2, 7, 3, 20);
  CHECK(part.height() == 3);
  CHECK(part.width() == 20);
  CHECK(part(3, 2, 19) == image(3, 4, 26));
  CHECK(padding_is_zero(part));
  CHECK(crop(image, 0, 0, 6, 33) == image);
  CHECK_THROWS_WITH(crop(image, 4, 0, 3, 33), Catch::Contains("33 x 3 at column 0, row 4 of 33 x 6"));
}

TEST_CASE("a size half as large is the mean of four pixels") {
  const Image image = counting(2, 6, 10);
  const Image half = resize_area(image, 3, 5);
  for (int y = 0; y < 3; ++y) {
    for (int x = 0; x < 5; ++x) {
      const float mean4 = (image(1, 2 * y, 2 * x) + image(1, 2 * y, 2 * x + 1) + image(1, 2 * y + 1, 2 * x) +
                           image(1, 2 * y + 1, 2 * x + 1)) /
                          4;
      CHECK(half(1, y, x) == mean4);
    }
  }
  CHECK(padding_is_zero(half));
}

TEST_CASE("resizing by area keeps the mean, a constant and the same size") {
  const Image image = counting(1, 7, 11);
  CHECK(resize_area(image, 7, 11) == image);
  for (const auto& [height, width] : {std::pair{3, 4}, {1, 1}, {5, 11}, {7, 2}, {14, 33}, {8, 12}}) {
    const Image resized = resize_area(image, height, width);
    CHECK(mean(resized) == Approx(mean(image)).epsilon(1e-6));
    Image flat(1, 7, 11);
    for (int y = 0; y < 7; ++y) std::fill_n(flat.row(0, y), 11, 0.3f);
    const Image flat_resized = resize_area(flat, height, width);
    for (const float v : to_interleaved(flat_resized)) CHECK(v == Approx(0.3f).epsilon(1e-6));
  }
  // Columns [0,1.5) and [1.5,3) of 1 2 3.
  const Image three = from_interleaved(std::vector<float>{1, 2, 3}, 1, 3, 1);
  const Image two = resize_area(three, 1, 2);
  CHECK(two(0, 0, 0) == Approx((1 + 0.5 * 2) / 1.5));
  CHECK(two(0, 0, 1) == Approx((0.5 * 2 + 3) / 1.5));
  CHECK_THROWS_WITH(resize_area(image, 0, 4), Catch::Contains("11 x 7 to 4 x 0"));
}

TEST_CASE("an image beyond the limits is refused by name") {
  const ImageLimits limits{100, 64 * 100 * 2};
  CHECK_NOTHROW(check_image_size("a.png", 2, 100, 16, limits));
  CHECK_THROWS_WITH(check_image_size("a.png", 1, 7, 101, limits), "a.png: has 101 x 7 pixels; a side has at most 100");
  CHECK_THROWS_WITH(check_image_size("a.png", 3, 100, 16, limits),
                    "a.png: 3 channels of 16 x 100 pixels need more than the 12800 bytes allowed");
}

}  // namespace image_test
