#include "tests/support/failed_images.h"

#include <atomic>
#include <cctype>
#include <cmath>
#include <exception>
#include <filesystem>
#include <limits>
#include <stdexcept>

#include <catch2/catch.hpp>

#include "core/image_io.h"

namespace hsi4d::test {

namespace {

/// Numbers that a PNG can hold.
double shown(double x) { return std::isfinite(x) ? x : 0; }

template <class F>
Image image_of(int channels, int height, int width, F&& number) {
  Image image(channels, height, width);
  std::size_t i = 0;
  for (int c = 0; c < channels; ++c) {
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) image(c, y, x) = static_cast<float>(number(i++));
    }
  }
  return image;
}

std::string file_name(const std::string& name) {
  static std::atomic<int> calls = 0;
  std::string text;
  for (const char c : name) {
    text += std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '-' ? c : '_';
  }
  return text + "_" + std::to_string(++calls);
}

std::string save(const std::string& name, const std::vector<double>& computed, const std::vector<double>& expected,
                 int height, int width) {
  const std::size_t pixels = static_cast<std::size_t>(height) * static_cast<std::size_t>(width);
  if (pixels == 0 || computed.size() != expected.size() ||
      (computed.size() != pixels && computed.size() != 3 * pixels)) {
    throw std::runtime_error(std::to_string(computed.size()) + " and " + std::to_string(expected.size()) +
                             " numbers are no two images of " + std::to_string(width) + "x" + std::to_string(height));
  }
  const int channels = static_cast<int>(computed.size() / pixels);
  const std::filesystem::path folder = HSI4D_FAILED_IMAGES;
  std::filesystem::create_directories(folder);
  const std::string begin = (folder / file_name(name)).string();
  write_image(begin + "_computed.png",
              image_of(channels, height, width, [&](std::size_t i) { return shown(computed[i]); }));
  write_image(begin + "_expected.png",
              image_of(channels, height, width, [&](std::size_t i) { return shown(expected[i]); }));
  write_image(begin + "_difference.exr",
              image_of(channels, height, width, [&](std::size_t i) { return computed[i] - expected[i]; }));
  return "saved " + begin + "_computed.png\n      " + begin + "_expected.png\n      " + begin + "_difference.exr";
}

}  // namespace

std::string save_failed_images(const std::string& name, const std::vector<double>& computed,
                               const std::vector<double>& expected, int height, int width) {
  try {
    return save(name, computed, expected, height, width);
  } catch (const std::exception& error) {  // what failed is the test's business, not this
    return "the images of " + name + " could not be saved: " + error.what();
  }
}

double check_image(const std::string& name, const std::vector<double>& computed, const std::vector<double>& expected,
                   int height, int width, double tolerance) {
  double worst = computed.size() == expected.size() ? 0 : std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < std::min(computed.size(), expected.size()); ++i) {
    const double error = std::abs(computed[i] - expected[i]);
    if (!(error <= worst)) worst = error;
  }
  INFO(name);
  if (!(worst <= tolerance)) UNSCOPED_INFO(save_failed_images(name, computed, expected, height, width));
  CHECK(worst <= tolerance);
  return worst;
}

}  // namespace hsi4d::test
