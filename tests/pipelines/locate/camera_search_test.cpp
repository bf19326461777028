#include "pipelines/locate/camera_search.h"

#include <cmath>

#include <catch2/catch.hpp>

#include "core/angles.h"
#include "core/check.h"
#include "core/parallel.h"
#include "optim/metrics.h"
#include "pipelines/draw/image_of_scene.h"
#include "pipelines/synthetic/scene.h"

namespace camera_search_test {

using namespace hsi4d;

namespace {

const Gaussians& room() {
  static const Gaussians scene = synthetic_scene(SyntheticSceneKind::kLivingRoom, 8000, ScenePlan{}, 3);
  return scene;
}

Camera true_camera(int width = 128, int height = 96) {
  return {width, height, 1.0 * width, 1.0 * width, width / 2.0, height / 2.0, look_at({0.3, -3, 1.5}, {0, 0.8, 0.8})};
}

Image picture_of(const Camera& camera) {
  SceneView view;
  view.camera = camera;
  return render_picture({room(), {}}, view).image;
}

Camera disturbed(const Camera& camera, double metres, double degrees) {
  return spread_cameras(camera, 8, metres, degrees).at(5);
}

PoseError error_of(const Camera& camera, const Camera& truth) {
  return camera_error(camera.camera_from_world, truth.camera_from_world);
}

/// Somebody in the picture, and where.
Image painted_over(Image& picture) {
  Image weight(1, picture.height(), picture.width());
  for (float& value : weight.data()) value = 1;
  for (int y = picture.height() / 4; y < picture.height(); ++y) {
    for (int x = picture.width() / 3; x < picture.width() / 2; ++x) {
      weight(0, y, x) = 0;
      for (int c = 0; c < 3; ++c) picture(c, y, x) = c == 0 ? 1.0F : 0.0F;
    }
  }
  return weight;
}

}  // namespace

TEST_CASE("starts lie about the guess, as far away as they may") {
  const Camera guess = true_camera();
  const std::vector<Camera> cameras = spread_cameras(guess, 400, 0.3, 12);
  REQUIRE(cameras.size() == 400);
  CHECK(error_of(cameras[0], guess).translation_cm == 0);
  Index far = 0, turned = 0;
  for (const Camera& camera : cameras) {
    check_camera(camera);
    const PoseError error = error_of(camera, guess);
    CHECK(error.translation_cm <= 30.000001);
    CHECK(error.rotation_deg <= 12.000001);
    far += error.translation_cm > 15 ? 1 : 0;
    turned += error.rotation_deg > 6 ? 1 : 0;
  }
  CHECK(std::abs(far - 350) < 25);  // seven eighths of a ball are beyond half of its radius
  CHECK(std::abs(turned - 350) < 25);
}

TEST_CASE("a camera is found again from a guess that is 15 cm and 6 degrees off, with somebody in the picture") {
  const Camera truth = true_camera();
  Image picture = picture_of(truth);
  const Image weight = painted_over(picture);
  const Camera guess = disturbed(truth, 0.2, 8);
  REQUIRE(error_of(guess, truth).translation_cm > 10);
  CameraSearch search;
  search.starts = 64;
  const FoundCamera found = find_camera(room(), guess, picture, weight, search);
  CHECK(error_of(found.camera, truth).translation_cm < 0.3);
  CHECK(error_of(found.camera, truth).rotation_deg < 0.05);
  CHECK(found.camera.fx == truth.fx);
  CHECK(found.tried == 12);
  CHECK(found.agreeing >= 2);
  const ComparedCamera before = compare_camera(room(), guess, picture, weight, search),
                       after = compare_camera(room(), found.camera, picture, weight, search);
  CHECK(after.psnr_db > 35);
  CHECK(after.psnr_db > before.psnr_db + 10);
  const Image image = comparison_image(after);
  CHECK(image.width() == 3 * 128);
  CHECK(image(0, 60, 2 * 128 + 50) == 0);  // where nothing counts
  CHECK(image(0, 60, 50) == 1);
}

TEST_CASE("the focal length is found with the camera where that is asked for") {
  const Camera truth = true_camera();
  const Image picture = picture_of(truth);
  Camera guess = disturbed(truth, 0.05, 2);
  guess.fx *= 1.08;
  guess.fy *= 1.08;
  CameraSearch search;
  search.starts = 16;
  search.spread_m = 0.1;
  search.spread_deg = 3;
  search.moves_focal = true;
  const FoundCamera found = find_camera(room(), guess, picture, {}, search);
  CHECK(found.camera.fx == Approx(truth.fx).epsilon(0.003));
  CHECK(found.camera.fy / found.camera.fx == Approx(1));
  CHECK(error_of(found.camera, truth).translation_cm < 1);
}

TEST_CASE("a guess that nothing betters stays, and pictures are reduced to the guess's size") {
  const Camera truth = true_camera();
  const Image large = picture_of(true_camera(256, 192));
  CameraSearch search;
  search.starts = 4;
  search.spread_m = search.spread_deg = 0;
  search.render.blur = 0.13;  // of pixels that are means of smaller ones
  const FoundCamera found = find_camera(room(), truth, large, {}, search);
  CHECK(found.camera.width == 128);
  CHECK(error_of(found.camera, truth).translation_cm < 0.5);
  const Image exact = picture_of(truth);
  search.render = {};
  CHECK(error_of(find_camera(room(), truth, exact, {}, search).camera, truth).translation_cm < 0.02);
}

TEST_CASE("masks that leave nothing are refused, and a search can be stopped") {
  const Camera truth = true_camera();
  const Image picture = picture_of(truth);
  Image weight(1, 96, 128);
  weight(0, 10, 10) = 1;  // a pixel that is in no whole one of the smallest picture
  CHECK_THROWS_WITH(find_camera(room(), truth, picture, weight, {}), Catch::Contains("leave nothing of the picture"));
  Observer observer;
  int left = 3;
  observer.stop_requested = [&] { return --left < 0; };
  CHECK_THROWS_AS(find_camera(room(), truth, picture, {}, {}, observer), Interrupted);
}

TEST_CASE("the camera that is found has the same bits on any number of threads", "[parallel]") {
  const Camera truth = true_camera(64, 48);
  const Image picture = picture_of(truth);
  CameraSearch search;
  search.starts = 12;
  std::vector<Camera> found;
  for (const int threads : {1, 2, 3})
    with_threads(threads,
                 [&] { found.push_back(find_camera(room(), disturbed(truth, 0.1, 4), picture, {}, search).camera); });
  for (const Camera& camera : found) {
    CHECK(camera.camera_from_world.rotation == found[0].camera_from_world.rotation);
    CHECK(camera.camera_from_world.translation == found[0].camera_from_world.translation);
  }
}

}  // namespace camera_search_test
