#include "core/mask_image.h"

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/image_io.h"
#include "tests/support/palette_png.h"
#include "tests/support/temporary_folder.h"

namespace mask_image_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Message;
using Color = std::array<uint8_t, 4>;

namespace {

constexpr int kHeight = 48, kWidth = 64;
const std::vector<Color> kDavis = {{0, 0, 0, 255}, {128, 0, 0, 255}, {0, 128, 0, 255}, {128, 128, 128, 255}};
const std::string kAllowed =
    "; allowed are a grey mask, a palette image whose index 0 is background, and a mask that is the alpha of one "
    "colour";

bool in_square(int y, int x) { return 14 <= y && y < 34 && 22 <= x && x < 42; }

/// An image [C,H,W] of one colour in a square of 20x20 pixels, and another around it.
Image square(const std::vector<float>& inside, const std::vector<float>& outside) {
  Image image(static_cast<int>(inside.size()), kHeight, kWidth);
  for (int c = 0; c < image.channels(); ++c) {
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) image(c, y, x) = (in_square(y, x) ? inside : outside)[static_cast<size_t>(c)];
    }
  }
  return image;
}

/// The same of indices; `more` is that of the last pixel.
Bytes square_of(uint8_t inside, uint8_t outside, uint8_t more) {
  Bytes indices;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) indices.push_back(in_square(y, x) ? inside : outside);
  }
  indices.back() = more;
  return indices;
}

Image read_palette(const Bytes& indices, const std::vector<Color>& colors) {
  const TemporaryFolder here;
  write_file("m.png", palette_png(kWidth, kHeight, indices, colors));
  return read_mask_image("m.png");
}

}  // namespace

TEST_CASE("an index of a palette is a label, whatever its colour") {
  for (const uint8_t label : Bytes{1, 2, 3}) CHECK(read_palette(square_of(label, 0, 0), kDavis) == square({1}, {0}));
  CHECK(read_palette(square_of(0, 0, 0), kDavis) == square({0}, {0}));
  CHECK(read_palette(square_of(2, 2, 2), kDavis) == square({1}, {1}));
  CHECK_THROWS_MATCHES(read_palette(square_of(1, 0, 3), kDavis), DataError,
                       Message("m.png: holds the labels 1, 3; a mask shows one thing, so allowed are index 0, which is "
                               "background, and one label"));
  CHECK_THROWS_MATCHES(read_palette(square_of(0, 1, 1), {{0, 0, 255, 255}, {0, 0, 0, 255}}), DataError,
                       Message("m.png: is a colour mask: its palette has black at index 1, and a colour at index 0, "
                               "which is background" +
                               kAllowed));
}

TEST_CASE("a palette of greys is a grey picture, and of two greys with black the other is full") {
  const std::vector<Color> greys = {{255, 255, 255, 255}, {0, 0, 0, 255}, {102, 102, 102, 255}};
  CHECK(read_palette(square_of(0, 1, 1), greys) == square({1}, {0}));  // as packers of PNG order them
  Image soft = square({1}, {0});
  soft(0, kHeight - 1, kWidth - 1) = 0.4F;
  CHECK(read_palette(square_of(0, 1, 2), greys) == soft);
  std::vector<Color> ramp;  // what imaging libraries give to numbers without a palette
  for (int i = 0; i < 256; ++i) ramp.push_back({uint8_t(i), uint8_t(i), uint8_t(i), 255});
  CHECK(read_palette(square_of(1, 0, 0), ramp) == square({1}, {0}));
  CHECK(read_palette(square_of(0, 0, 0), ramp) == square({0}, {0}));
}

TEST_CASE("the alpha of a palette counts where its indices say nothing") {
  const Color clear = {255, 255, 255, 0}, white = {255, 255, 255, 255}, half = {255, 255, 255, 51};
  CHECK(read_palette(square_of(1, 0, 0), {clear, white}) == square({1}, {0}));
  CHECK(read_palette(square_of(0, 1, 1), {white, clear}) == square({1}, {0}));
  CHECK(read_palette(square_of(0, 0, 0), {clear, white}) == square({0}, {0}));
  Image soft = square({1}, {0});
  soft(0, kHeight - 1, kWidth - 1) = 0.2F;
  CHECK(read_palette(square_of(1, 0, 2), {clear, white, half}) == soft);
  CHECK(read_palette(square_of(1, 0, 0), {{0, 0, 0, 0}, {128, 0, 0, 128}}) == square({1}, {0}));  // drawn over pictures
}

TEST_CASE("a grey mask is its grey") {
  const Image mask = square({0.6F}, {0.2F});
  CHECK(mask_of(mask, "m") == mask);
  CHECK(mask_of(square({0.6F, 0.6F, 0.6F}, {0.2F, 0.2F, 0.2F}), "m") == mask);
  CHECK(mask_of(square({0.6F, 0.58F, 0.62F}, {0.2F, 0.2F, 0.25F}), "m") == mask);  // as JPEG and videos leave it
  CHECK(mask_of(square({0.6F, 1}, {0.2F, 1}), "m") == mask);
  CHECK(mask_of(square({0.6F, 0.6F, 0.6F, 1}, {0.2F, 0.2F, 0.2F, 1}), "m") == mask);
  const TemporaryFolder here;
  const Image wide = square({40000.0F / 65535}, {0});
  write_image("w.png", wide, {.png_bits = 16});
  CHECK(read_mask_image("w.png") == wide);
}

TEST_CASE("few greys that are neither black nor white look like labels") {
  const auto greys_of = [](const std::vector<int>& values) {
    Image mask(1, 1, static_cast<int>(values.size()));
    for (std::size_t x = 0; x < values.size(); ++x)
      mask(0, 0, static_cast<int>(x)) = static_cast<float>(values[x]) / 255;
    return label_greys(mask);
  };
  CHECK(greys_of({0, 0, 50, 100, 150, 50}) == std::vector<int>{50, 100, 150});
  CHECK(greys_of({0, 128}) == std::vector<int>{128});
  CHECK(greys_of({0, 0, 0}).empty());
  CHECK(greys_of({0, 255, 250, 1}).empty());
  CHECK(greys_of({0, 255, 255, 255, 255, 128}).empty());                    // an edge
  CHECK(greys_of({20, 40, 60, 80, 100, 120, 140, 160, 180, 255}).empty());  // a soft edge
}

TEST_CASE("a mask whose shape is in its alpha is the alpha") {
  const Image mask = square({0.6F}, {0});
  CHECK(mask_of(square({1, 1, 1, 0.6F}, {1, 1, 1, 0}), "m") == mask);
  CHECK(mask_of(square({0, 0, 0, 0.6F}, {0, 0, 0, 0}), "m") == mask);
  CHECK(mask_of(square({0, 0, 1, 0.6F}, {1, 0, 0, 0}), "m") == mask);  // what is behind full transparency is not seen
  CHECK(mask_of(square({1, 0.6F}, {1, 0}), "m") == mask);
  CHECK(mask_of(square({0.6F, 0.6F, 0.6F, 0.6F}, {0, 0, 0, 0}), "m") == mask);
  CHECK(mask_of(square({1, 1, 1, 0}, {1, 1, 1, 0}), "m") == square({0}, {0}));
  CHECK_THROWS_MATCHES(mask_of(square({1, 1, 1, 0.6F}, {0, 0, 0, 0.6F}), "m"), DataError,
                       Message("m: both its colours and its alpha vary, and either could be the mask" + kAllowed));
}

TEST_CASE("a colour mask is refused") {
  CHECK_THROWS_MATCHES(mask_of(square({0, 0, 1}, {0, 0, 0}), "m"), DataError,
                       Message("m: is a colour mask: row 14, column 22 is (0, 0, 255)" + kAllowed));
  CHECK_THROWS_AS(mask_of(square({1, 0, 0, 1}, {0, 0, 0, 1}), "m"), DataError);
  CHECK_THROWS_AS(mask_of(square({1, 1, 1}, {1, 0.9F, 1}), "m"), DataError);
}

}  // namespace mask_image_test
