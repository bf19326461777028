// Avatars are opaque: where the body's surface covers a pixel, hardly any light passes between their Gaussians.
#include <algorithm>
#include <cmath>
#include <filesystem>

#include <catch2/catch.hpp>

#include "body/procedural_body.h"
#include "body/smplx_file.h"
#include "pipelines/draw/posed_avatar.h"
#include "tests/support/mesh_coverage.h"

namespace avatar_cover_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

constexpr double kDegrees = 3.14159265358979323846 / 180;

/// From `turn` degrees beside the front (the rest pose looks along +z), so that `metre` pixels make a metre.
Camera camera_around(const BodyModel& body, double turn, double metre) {
  double low = 1e9, high = -1e9;
  for (std::size_t i = 1; i < body.vertices.size(); i += 3) {
    low = std::min(low, static_cast<double>(body.vertices[i]));
    high = std::max(high, static_cast<double>(body.vertices[i]));
  }
  constexpr double kDistance = 4;
  const Vector3<double> center(0, (low + high) / 2, 0);
  const Vector3<double> way(std::sin(turn * kDegrees), 0, std::cos(turn * kDegrees));
  Camera camera;
  camera.width = camera.height = static_cast<int>(2 * metre);
  camera.fx = camera.fy = kDistance * metre;
  camera.cx = camera.cy = metre;
  camera.camera_from_world = look_at(center + way * kDistance, center, Vector3<double>::UnitY());
  return camera;
}

struct Light {
  Index pixels = 0, holes = 0;
  double largest = 0;
};

/// Transmittance of the pixels that the surface covers, from four sides. The distance of neighbours is about four
/// pixels, or fewer where that would make an image of more than 1,600.
Light light_through(const BodyModel& body, const AvatarSettings& settings) {
  const Avatar avatar = surface_avatar(body, settings);
  const PosedGaussians gaussians = posed_avatar(avatar, rest_pose(avatar.joint_count()));
  const double metre = std::min(4 / std::sqrt(1.65 / static_cast<double>(settings.gaussians)), 800.0);
  Light light;
  for (const double turn : {0.0, 90.0, 180.0, 305.0}) {
    SceneView view;
    view.camera = camera_around(body, turn, metre);
    const SceneImage rendered = render_scene(gaussians, view);
    const std::vector<char> covered = covered_pixels(body, view.camera);
    for (std::size_t i = 0; i < covered.size(); ++i) {
      if (covered[i] == 0) continue;
      const double transmittance = 1 - rendered.alpha[i];
      ++light.pixels;
      light.holes += transmittance >= 1e-2 ? 1 : 0;
      light.largest = std::max(light.largest, transmittance);
    }
  }
  return light;
}

/// One pixel in 100,000 may pass more than 1 %: on the edge of a crease, where nothing lies behind it.
void check_opaque(const BodyModel& body, const AvatarSettings& settings) {
  const Light light = light_through(body, settings);
  CAPTURE(settings.gaussians, settings.detail, light.pixels, light.holes, light.largest);
  CHECK(light.pixels > 100000);
  CHECK(light.holes * 100000 <= light.pixels);
  CHECK(light.largest < 0.03);
}

/// The body of that file, or none, said aloud.
std::optional<BodyModel> shared_body() {
  const std::string path = std::string(HSI4D_SOURCE_DIR) + "/../shared/data/bodies/makehuman_smplx_layout.npz";
  if (std::filesystem::exists(path)) return rest_body(read_smplx(path));
  WARN("skipped: there is no " << path);
  return std::nullopt;
}

}  // namespace

TEST_CASE("an avatar of 20,000 Gaussians is opaque from all sides") {
  check_opaque(procedural_body(), {.gaussians = 20000});
  check_opaque(procedural_body(), {.gaussians = 20000, .detail = 0});
  if (const auto body = shared_body()) check_opaque(*body, {.gaussians = 20000});
}

TEST_CASE("an avatar with too little cover is not opaque") {
  CHECK(light_through(procedural_body(), {.gaussians = 20000, .cover = 0.4}).largest > 0.1);
}

TEST_CASE("avatars of 50,000 and 300,000 Gaussians are opaque from all sides", "[full]") {
  for (const Index gaussians : {50000, 300000}) {
    check_opaque(procedural_body(), {.gaussians = gaussians});
    if (const auto body = shared_body()) {
      check_opaque(*body, {.gaussians = gaussians});
      check_opaque(*body, {.gaussians = gaussians, .detail = 0});
    }
  }
}

}  // namespace avatar_cover_test
