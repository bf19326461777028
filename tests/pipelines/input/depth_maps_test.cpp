// Depth maps: every kind of file, sizes, confidences, and what is refused.
#include "pipelines/input/depth_maps.h"

#include <cmath>
#include <limits>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/exr.h"
#include "core/image_io.h"
#include "core/log.h"
#include "core/npz.h"
#include "tests/support/temporary_folder.h"

namespace depth_maps_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
namespace fs = std::filesystem;

namespace {

constexpr int kFrames = 3, kWidth = 8, kHeight = 6;

Camera camera() {
  Camera camera;
  camera.width = kWidth;
  camera.height = kHeight;
  return camera;
}

/// A map that differs from pixel to pixel.
Image slope(int height = kHeight, int width = kWidth, float scale = 1) {
  Image map(1, height, width);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) map(0, y, x) = scale * static_cast<float>(1 + x + 10 * y) / 64;
  }
  return map;
}

std::vector<float> numbers(const Image& image) { return to_interleaved(image); }

/// A folder with a video of black frames, and one of maps.
struct Workshop {
  TemporaryFolder here;

  Workshop() {
    for (const char* folder : {"frames", "maps", "sure"}) fs::create_directory(folder);
    for (int t = 0; t < kFrames; ++t) write_image("frames/000" + std::to_string(t) + ".png", Image(3, kHeight, kWidth));
  }
  static DepthMaps find(bool with_confidence = false) {
    DataSettings data;
    data.frames = "frames";
    data.depth_maps = "maps";
    if (with_confidence) data.depth_confidence = "sure";
    return find_depth_maps(data, FrameSource("frames", {}));
  }
  static DepthMap read(Index frame, bool with_confidence = false) {
    return read_depth_map(find(with_confidence), camera(), frame);
  }
  template <class F>
  static std::string fault(const F& read) {
    try {
      read();
    } catch (const UserError& error) {
      return error.what();
    } catch (const DataError& error) {
      return error.what();
    }
    return "no fault";
  }
  static std::string fault() {
    return fault([] { read(0); });
  }
};

void write_npy(const std::string& file, std::vector<std::int64_t> shape, const std::vector<float>& values) {
  write_file(file, encode_npy<float>(shape, values));
}

/// Mean and standard deviation of what is known.
std::pair<double, double> moments(const DepthMap& map) {
  double sum = 0, squares = 0, weight = 0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const double w = static_cast<double>(map.weights(0, y, x)), value = static_cast<double>(map.values(0, y, x));
      weight += w;
      sum += w * value;
      squares += w * value * value;
    }
  }
  return {sum / weight, std::sqrt(squares / weight - sum / weight * sum / weight)};
}

}  // namespace

TEST_CASE("a depth map is the same from every kind of file, whatever its scale and shift") {
  const Workshop workshop;
  const Image map = slope();
  write_image("maps/0000.exr", map);
  const DepthMap expected = Workshop::read(0);
  CHECK(moments(expected).first == Approx(0).margin(1e-6));
  CHECK(moments(expected).second == Approx(1).epsilon(1e-6));
  CHECK(expected.values(0, 0, 0) < expected.values(0, 5, 7));
  const auto check_same = [&](const char* what, double tolerance) {
    INFO(what);
    const DepthMap found = Workshop::read(0);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        CHECK(found.weights(0, y, x) == 1);
        CHECK(std::abs(found.values(0, y, x) - expected.values(0, y, x)) < tolerance);
      }
    }
  };
  fs::remove("maps/0000.exr");
  write_image("maps/0000.png", map, {.png_bits = 16});
  check_same("grey of 16 bits", 1e-4);
  Image three(3, kHeight, kWidth);
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < kHeight; ++y) std::copy_n(map.row(0, y), kWidth, three.row(c, y));
  }
  write_image("maps/0000.png", three, {.png_bits = 16});
  check_same("three channels alike", 1e-4);
  fs::remove("maps/0000.png");
  Layers layers{{"Z", "R"}, Image(2, kHeight, kWidth), ""};
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) layers.planes(0, y, x) = 40 * map(0, y, x) - 3000;
  }
  write_layers("maps/0000.exr", layers);
  check_same("a layer Z", 1e-3);
  fs::remove("maps/0000.exr");
  write_npy("maps/0000.npy", {1, kHeight, kWidth, 1}, numbers(slope(kHeight, kWidth, 100)));
  check_same("an array", 1e-5);
  fs::remove("maps/0000.npy");
  NpzWriter archive;
  archive.add<float>("disparity", {kHeight, kWidth}, numbers(map));
  archive.add<float>("focal", {1}, {500});
  archive.write("maps/0000.npz");
  check_same("an array of an archive", 1e-5);
}

TEST_CASE("a depth map of another size gives each pixel the nearest") {
  const Workshop workshop;
  write_npy("maps/0000.npy", {2 * kHeight, 2 * kWidth}, numbers(slope(2 * kHeight, 2 * kWidth)));
  write_npy("maps/0001.npy", {kHeight / 2, kWidth / 2}, numbers(slope(kHeight / 2, kWidth / 2)));
  write_npy("maps/0002.npy", {kHeight, kWidth + 2}, numbers(slope(kHeight, kWidth + 2)));
  const DepthMap larger = Workshop::read(0), smaller = Workshop::read(1);
  const auto step = [](const DepthMap& map, int y, int x) { return map.values(0, y, x) - map.values(0, 0, 0); };
  CHECK(step(larger, 1, 0) == Approx(10 * step(larger, 0, 1)).epsilon(1e-5));
  CHECK(step(smaller, 0, 1) == 0);
  CHECK(step(smaller, 0, 2) > 0);
  CHECK_THAT(Workshop::fault([] { Workshop::read(2); }),
             Contains("maps/0002.npy: is 10x6 pixels, the camera's image 8x6; allowed: any size of its shape"));
}

TEST_CASE("pixels of a depth map that are 0 or no number are not known, and confidences weigh the others") {
  const Workshop workshop;
  std::vector<float> map = numbers(slope()), sure(map.size(), 4);
  map[3] = 0, map[9] = std::nanf(""), map[17] = std::numeric_limits<float>::infinity(), map[20] = 1e6F;
  sure[20] = 0, sure[21] = 1, sure[22] = std::nanf("");
  write_npy("maps/0000.npy", {kHeight, kWidth}, map);
  write_npy("sure/0000.npy", {kHeight, kWidth}, sure);
  const DepthMap alike = Workshop::read(0), weighed = Workshop::read(0, true);
  for (const int i : {3, 9, 17}) {
    CHECK(alike.weights(0, i / kWidth, i % kWidth) == 0);
    CHECK(alike.values(0, i / kWidth, i % kWidth) == 0);
  }
  CHECK(alike.weights(0, 2, 4) == 1);
  CHECK(weighed.weights(0, 2, 4) == 0);
  CHECK(weighed.weights(0, 2, 5) == 0.25);
  CHECK(weighed.weights(0, 2, 6) == 0);
  CHECK(weighed.weights(0, 0, 0) == 1);
  CHECK(moments(weighed).first == Approx(0).margin(1e-6));
  CHECK(moments(weighed).second == Approx(1).epsilon(1e-6));
  sure[5] = -1;
  write_npy("sure/0000.npy", {kHeight, kWidth}, sure);
  CHECK_THAT(Workshop::fault([] { Workshop::read(0, true); }),
             Contains("sure/0000.npy: a confidence of -1; allowed: 0 and more"));
  fs::rename("sure/0000.npy", "sure/0001.npy");
  CHECK_THAT(Workshop::fault([] { Workshop::read(0, true); }),
             Contains("sure: has no file for the depth map maps/0000.npy; allowed: one for each"));
}

TEST_CASE("frames without a depth map, and maps that say nothing, are counted") {
  const Workshop workshop;
  write_image("maps/0001.exr", slope());
  write_npy("maps/0002.npy", {kHeight, kWidth}, std::vector<float>(kHeight * kWidth, 2.5F));
  std::string told;
  const LogSink sink = log_to([&told](LogLevel, std::string_view text) { told += text; });
  const DepthMaps maps = Workshop::find();
  CHECK_THAT(told, Contains("maps: has no depth map for 1 of 3 frames; the loss depth_map is off there"));
  CHECK(read_depth_map(maps, camera(), 0).values.empty());
  CHECK_FALSE(read_depth_map(maps, camera(), 1).values.empty());
  CHECK(read_depth_map(maps, camera(), 2).values.empty());
  check_depth_maps(maps, camera());
  CHECK_THAT(told, Contains("maps/0002.npy: says nothing of depths: all that is known of it is one number; the "
                            "loss depth_map is off in frame 2"));
  fs::remove("maps/0001.exr");
  CHECK_THAT(Workshop::fault([] { check_depth_maps(Workshop::find(), camera()); }),
             Contains("all that is known of it is one number, as in all other depth maps"));
}

TEST_CASE("what is no depth map is refused by name") {
  const Workshop workshop;
  CHECK_THAT(Workshop::fault(), Contains("maps: has no depth map for any of 3 frames; allowed: a file has the name of "
                                         "its frame, the first \"0000\", and ends in .png, .exr, .npy or .npz"));
  Image colored(3, kHeight, kWidth);
  colored(1, 2, 3) = 1;
  write_image("maps/0000.png", colored);
  CHECK_THAT(Workshop::fault(),
             Contains("maps/0000.png: has 3 channels; allowed: a grey picture, of one channel or three alike"));
  write_image("maps/0000.exr", slope());
  CHECK_THAT(Workshop::fault(),
             Contains("maps/0000.png, maps/0000.exr: both are of the frame \"0000.png\"; remove one"));
  fs::remove("maps/0000.exr"), fs::remove("maps/0000.png");
  write_npy("maps/0000.npy", {2, 3, 4}, std::vector<float>(24));
  CHECK_THAT(Workshop::fault(), Contains("has shape [2,3,4]; allowed: [H,W]"));
  fs::remove("maps/0000.npy");
  NpzWriter archive;
  archive.add<float>("a", {1}, {1});
  archive.add<float>("b", {1}, {1});
  archive.write("maps/0000.npz");
  CHECK_THAT(Workshop::fault(), Contains("maps/0000.npz: holds a, b; allowed: one array, or one of the names depth, "
                                         "disparity, confidence"));
  write_file("maps/0000.npz", Bytes{1, 2, 3});
  CHECK_THAT(Workshop::fault(), Contains("maps/0000.npz"));
}

}  // namespace depth_maps_test
