#include "pipelines/graph/frame_masks.h"

#include <numbers>

#include <catch2/catch.hpp>

namespace frame_masks_test {

using namespace hsi4d;

TEST_CASE("the centre of a mask", "[frame_masks]") {
  Image mask(1, 4, 6);
  CHECK(mask_center(mask, 0.5) == Vector3<double>(0, 0, 0));
  mask(0, 1, 2) = 0.25;
  CHECK(mask_center(mask, 0.5) == Vector3<double>(0, 0, 0));  // too faint to be the object
  mask(0, 1, 2) = 1;
  CHECK(mask_center(mask, 0.5) == Vector3<double>(2.5, 1.5, 1));
  mask(0, 3, 2) = 1;
  CHECK(mask_center(mask, 0.5) == Vector3<double>(2.5, 2.5, 2));
}

TEST_CASE("the area that an object would cover is that of its Gaussians' centres in the image", "[frame_masks]") {
  Camera camera = {200, 150, 160, 150, 100, 75, {}};
  Gaussians disc;
  std::vector<float> places;
  for (double y = -1; y <= 1; y += 0.02) {
    for (double x = -1; x <= 1; x += 0.02) {
      if (x * x + y * y > 1) continue;
      for (const double number : {0.3 * x, 0.2 * y, 0.0}) places.push_back(static_cast<float>(number));
    }
  }
  disc.means = places;
  disc.opacity_logits.resize(places.size() / 3);
  const ObjectPose pose = {Vector3<double>(0, 0, 0.7), Vector3<double>(0.4, -0.2, 2)};
  const double ellipse =
      std::numbers::pi * 0.3 * 0.2 * 160 * 150 / 4;  // a turn about the view's axis hardly changes it
  CHECK(covered_area(disc, pose, camera) == Approx(ellipse).epsilon(0.02));
  camera.camera_from_world.translation = {0, 0, 2};  // twice as far
  CHECK(covered_area(disc, pose, camera) == Approx(ellipse / 4).epsilon(0.02));
  camera.camera_from_world.translation = {0, 0, -5};  // behind
  CHECK(covered_area(disc, pose, camera) == 0);
}

}  // namespace frame_masks_test
