#include "pipelines/footage/plate.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include <catch2/catch.hpp>

#include "core/angles.h"
#include "core/check.h"
#include "core/file.h"
#include "core/image_io.h"
#include "pipelines/draw/image_of_scene.h"
#include "tests/support/temporary_folder.h"

namespace plate_test {

using namespace hsi4d;
using hsi4d::test::TemporaryFolder;

namespace {

constexpr int kWidth = 96, kHeight = 64;

const Camera kWhole{kWidth, kHeight, 100, 100, kWidth / 2.0, kHeight / 2.0, {}},
    kHalf{kWidth / 2, kHeight / 2, 50, 50, kWidth / 4.0, kHeight / 4.0, {}};

/// Smooth, of whole 255ths.
float background(int c, int y, int x) {
  const double value = 0.5 + 0.3 * std::sin(0.2 * x + 0.3 * c) * std::cos(0.07 * y - 0.3 * c);
  return static_cast<float>(std::round(255 * value) / 255);
}

Image background_image() {
  Image image(3, kHeight, kWidth);
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) image(c, y, x) = background(c, y, x);
    }
  }
  return image;
}

/// The video of frames/ and masks/human/ in the current folder.
ClipVideo video_here() {
  DataSettings data;
  data.frames = "frames";
  data.masks = "masks";
  data.video_rate = 10;
  return open_video(data, {});
}

void make_folders() {
  std::filesystem::create_directories("frames");
  std::filesystem::create_directories("masks/human");
}

/// Writes frames in which a bright square goes to the right, and its masks.
/// @param step_px  of the square, a frame; @param sway_px  of the background, every second frame
ClipVideo square_video(int frames, int step_px, int sway_px = 0) {
  make_folders();
  constexpr int kSize = 20;
  for (int t = 0; t < frames; ++t) {
    Image image(3, kHeight, kWidth), mask(1, kHeight, kWidth);
    const int left = 10 + t * step_px, top = 20;
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const bool is_square = x >= left && x < left + kSize && y >= top && y < top + kSize;
        mask(0, y, x) = is_square ? 1 : 0;
        for (int c = 0; c < 3; ++c) image(c, y, x) = is_square ? 1 : background(c, y, x + (t % 2) * sway_px);
      }
    }
    const std::string name = "000" + std::to_string(t) + ".png";
    write_image("frames/" + name, image);
    write_image("masks/human/" + name, mask);
  }
  return video_here();
}

double psnr_of(const Image& a, const Image& b) {
  double squares = 0;
  for (int c = 0; c < a.channels(); ++c) {
    for (int y = 0; y < a.height(); ++y) {
      for (int x = 0; x < a.width(); ++x) squares += std::pow(static_cast<double>(a(c, y, x) - b(c, y, x)), 2);
    }
  }
  return -10 * std::log10(squares / (a.channels() * a.height() * a.width()));
}

Camera camera_looking(double height, double pitch_deg) {
  Camera camera{kWidth, kHeight, 100, 100, kWidth / 2.0, kHeight / 2.0, {}};
  const Vector3<double> eye(3, -2, height);
  const double pitch = pitch_deg * kDegree;
  camera.camera_from_world = look_at(eye, eye + Vector3<double>(0, std::cos(pitch), -std::sin(pitch)));
  return camera;
}

}  // namespace

TEST_CASE("the median shows what is behind somebody who passes") {
  const TemporaryFolder folder;
  const Plate plate = plate_of(square_video(6, 9), kWhole);
  CHECK(plate.seen == 1);
  CHECK(plate.unrest_px == 0);
  CHECK(plate.is_still);
  CHECK(psnr_of(plate.image, background_image()) > 100);
}

TEST_CASE("what is always covered is filled from around it") {
  const TemporaryFolder folder;
  const Plate plate = plate_of(square_video(3, 0), kWhole);
  CHECK(plate.seen == Approx(1 - 22.0 * 22.0 / (kWidth * kHeight)));  // grown by a pixel
  const Image truth = background_image();
  CHECK(psnr_of(plate.image, truth) > 30);
  double worst = 0;
  for (int y = 19; y < 41; ++y) {
    for (int x = 9; x < 31; ++x)
      worst = std::max(worst, std::abs(static_cast<double>(plate.image(0, y, x) - truth(0, y, x))));
  }
  CHECK(worst < 0.2);  // of colours that span 0.6
}

TEST_CASE("a background that moves is told, and frame 0 is the plate") {
  const TemporaryFolder folder;
  const Plate plate = plate_of(square_video(6, 9, 12), kWhole);
  CHECK_FALSE(plate.is_still);
  CHECK(plate.unrest_px > 1);
  CHECK(plate.seen == Approx(1 - 22.0 * 22.0 / (kWidth * kHeight)));
  CHECK(psnr_of(plate.image, background_image()) > 30);
}

TEST_CASE("a pan that leaves no edge in the median is told too") {
  const TemporaryFolder folder;
  make_folders();
  for (int t = 0; t < 4; ++t) {
    Image image(3, kHeight, kWidth);
    for (int c = 0; c < 3; ++c) {
      for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < kWidth; ++x) image(c, y, x) = (x / 8 + t) % 2 == 0 ? 0.25F : 0.75F;
      }
    }
    write_image("frames/000" + std::to_string(t) + ".png", image);
    write_image("masks/human/000" + std::to_string(t) + ".png", Image(1, kHeight, kWidth));
  }
  CHECK_FALSE(plate_of(video_here(), kWhole).is_still);
}

TEST_CASE("larger frames are reduced") {
  const TemporaryFolder folder;
  const Plate plate = plate_of(square_video(6, 9), kHalf);
  CHECK(psnr_of(plate.image, resize_area(background_image(), kHeight / 2, kWidth / 2)) > 40);
}

TEST_CASE("masks that cover all leave no background") {
  const TemporaryFolder folder;
  const Image all = [] {
    Image mask(1, kHeight, kWidth);
    for (int y = 0; y < kHeight; ++y) std::fill_n(mask.row(0, y), kWidth, 1.0F);
    return mask;
  }();
  make_folders();
  for (const char* const name : {"0000.png", "0001.png"}) {
    write_image(std::string("frames/") + name, background_image());
    write_image(std::string("masks/human/") + name, all);
  }
  CHECK_THROWS_WITH(plate_of(video_here(), kWhole), Catch::Contains("covers every pixel in all frames"));
}

TEST_CASE("the camera sees a plate's Gaussians as the plate") {
  const Image plate = background_image();
  for (const double pitch : {-15.0, 0.0, 12.0, 40.0, 90.0}) {
    const Camera camera = camera_looking(1.5, pitch);
    SceneView view;
    view.camera = camera;
    const Gaussians scene = scene_of_plate(plate, camera, {6, 2}, view.settings);
    view.precision = Precision::kReference;
    CAPTURE(pitch);
    CHECK(psnr_of(render_picture({scene, {}}, view).image, plate) > 42);
  }
}

TEST_CASE("a plate's Gaussians lie on the ground and on a wall") {
  const Camera camera = camera_looking(1.5, 10);
  const Gaussians scene = scene_of_plate(background_image(), camera, {6, 2}, {});
  Index ground = 0, wall = 0;
  for (std::size_t i = 0; i < static_cast<std::size_t>(scene.count()); ++i) {
    const Vector3<float> mean(scene.means.data() + 3 * i);
    const bool is_ground = std::abs(mean[2]) < 1e-5F;
    ground += is_ground ? 1 : 0;
    wall += !is_ground && std::abs(mean[1] - 4) < 1e-4F && mean[2] > 0 ? 1 : 0;  // the camera is at y = −2
    if (is_ground) CHECK(mean[1] < 4.001F);
  }
  CHECK(ground > scene.count() / 5);
  CHECK(wall > scene.count() / 5);
  CHECK(ground + wall == scene.count());
}

TEST_CASE("around the image a plate goes on with its border's colours") {
  const Image plate = background_image();
  const Camera camera = camera_looking(1.5, 10);
  SceneView view;
  const Gaussians scene =
      scene_of_plate(plate, camera, {.wall_distance = 6, .spacing_px = 2, .margin = 0.25}, view.settings);
  view.camera = cropped(camera, -20, -20, kWidth + 40, kHeight + 40);
  const Image wide = render_picture({scene, {}}, view).image;
  CHECK(psnr_of(crop(wide, 20, 20, kHeight, kWidth), plate) > 38);
  double worst = 0;
  for (int y = 0; y < kHeight; ++y)
    worst = std::max(worst, std::abs(static_cast<double>(wide(0, y + 20, 4) - plate(0, y, 0))));
  CHECK(worst < 0.15);
}

TEST_CASE("masks with other names than the frames' are refused") {
  const TemporaryFolder folder;
  square_video(3, 9);
  for (const char* const name : {"0000.png", "0001.png", "0002.png"})
    std::filesystem::rename(std::string("masks/human/") + name, std::string("masks/human/x_") + name);
  CHECK_THROWS_WITH(video_here(), Catch::Contains("belong to no frame"));
}

TEST_CASE("a camera under the ground is refused") {
  CHECK_THROWS_AS(scene_of_plate(background_image(), camera_looking(-0.1, 0), {}, {}), InternalError);
}

}  // namespace plate_test
