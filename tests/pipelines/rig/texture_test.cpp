#include "pipelines/rig/texture.h"

#include <catch2/catch.hpp>

namespace texture_test {

using namespace hsi4d;

namespace {

/// Two rows of two texels: red, green above; blue, white below.
Image four_colors() {
  Image image(3, 2, 2);
  image(0, 0, 0) = image(1, 0, 1) = image(2, 1, 0) = 1;
  for (int c = 0; c < 3; ++c) image(c, 1, 1) = 1;
  return image;
}

constexpr TextureWrap kRepeat = TextureWrap::kRepeat;

}  // namespace

TEST_CASE("a texture's v goes up from the bottom edge") {
  const Texture texture = texture_from(four_colors());
  CHECK(look_up(texture, 0.25, 0.75, 1, kRepeat, kRepeat) == std::array<float, 4>{1, 0, 0, 1});
  CHECK(look_up(texture, 0.25, 0.25, 1, kRepeat, kRepeat) == std::array<float, 4>{0, 0, 1, 1});
  CHECK(look_up(texture, 0.5, 0.75, 1, kRepeat, kRepeat) == std::array<float, 4>{0.5F, 0.5F, 0, 1});
}

TEST_CASE("beyond its edges a texture is repeated, held or mirrored") {
  const Texture texture = texture_from(four_colors());
  const std::array<float, 4> red = {1, 0, 0, 1}, green = {0, 1, 0, 1};
  CHECK(look_up(texture, 1.25, 0.75, 1, kRepeat, kRepeat) == red);
  CHECK(look_up(texture, -0.25, -0.25, 1, kRepeat, kRepeat) == green);
  CHECK(look_up(texture, 1.25, 0.75, 1, TextureWrap::kClamp, kRepeat) == green);
  CHECK(look_up(texture, 1.25, 0.75, 1, TextureWrap::kMirror, kRepeat) == green);
  CHECK(look_up(texture, 1e12, 0.75, 1, kRepeat, kRepeat)[2] == 0);
}

TEST_CASE("a coarse look is a mean, in which what is transparent has no colour") {
  Image image(4, 2, 2);
  image(0, 0, 0) = image(3, 0, 0) = 1;  // red; the others are transparent, and green
  for (const auto& [y, x] : {std::pair{0, 1}, {1, 0}, {1, 1}}) image(1, y, x) = 1;
  const Texture texture = texture_from(image);
  CHECK(texture.has_alpha);
  const std::array<float, 4> mean = look_up(texture, 0.3, 0.3, 16, kRepeat, kRepeat);
  CHECK(mean[0] == 1);
  CHECK(mean[1] == 0);
  CHECK(mean[3] == Approx(0.25).margin(0.01));
}

}  // namespace texture_test
