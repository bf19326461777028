#include "tests/support/failed_images.h"

#include <filesystem>
#include <limits>
#include <sstream>

#include <catch2/catch.hpp>

#include "core/image_io.h"

namespace failed_images_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;

namespace {

/// The paths that a text names; they are removed when it ends.
struct Saved {
  std::vector<std::string> files;

  explicit Saved(const std::string& text) {
    std::istringstream words(text);
    for (std::string word; words >> word;) {
      if (word.find('/') != std::string::npos) files.push_back(word);
    }
  }
  ~Saved() {
    std::error_code error;
    for (const std::string& file : files) std::filesystem::remove(file, error);
  }
};

}  // namespace

TEST_CASE("a failing image test leaves both images and their difference") {
  const int height = 2, width = 3;
  std::vector<double> expected(18, 0.25), computed = expected;
  computed[7] += 0.5;  // green, row 0, column 1
  const Saved saved(save_failed_images("a scene, default", computed, expected, height, width));
  REQUIRE(saved.files.size() == 3);
  CHECK_THAT(saved.files[0],
             Contains("/failed_images/a_scene__default_") && Catch::Matchers::EndsWith("_computed.png"));
  CHECK_THAT(saved.files[1], Catch::Matchers::EndsWith("_expected.png"));
  CHECK_THAT(saved.files[2], Catch::Matchers::EndsWith("_difference.exr"));
  const Image a = read_image(saved.files[0]), b = read_image(saved.files[1]), difference = read_image(saved.files[2]);
  CHECK(a(1, 0, 1) == Approx(0.75).margin(1 / 255.0));
  CHECK(b(1, 0, 1) == Approx(0.25).margin(1 / 255.0));
  CHECK(difference.channels() == 3);
  CHECK(difference.height() == height);
  CHECK(difference.width() == width);
  CHECK(difference(1, 0, 1) == 0.5F);
  CHECK(difference(1, 0, 2) == 0);
  const Saved again(save_failed_images("a scene, default", computed, expected, height, width));
  CHECK(again.files != saved.files);
}

TEST_CASE("images of a failing test are saved whatever is in them, or it is told why not") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Saved saved(save_failed_images("broken", {nan, 2, -1, 0.5}, {0, 0, 0, 0}, 2, 2));
  REQUIRE(saved.files.size() == 3);
  CHECK(read_image(saved.files[0])(0, 0, 1) == 1);
  CHECK(save_failed_images("odd", {1, 2}, {1, 2}, 2, 2) ==
        "the images of odd could not be saved: 2 and 2 numbers are no two images of 2x2");
  CHECK(check_image("equal", {1, 2, 3, 4}, {1, 2, 3, 4.5}, 2, 2, 0.5) == 0.5);
}

}  // namespace failed_images_test
