#include "pipelines/draw/image_cotangent.h"

#include <numeric>

#include <catch2/catch.hpp>

#include "core/random.h"
#include "tests/support/small_clip.h"

namespace image_cotangent_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

SceneView view_in(Precision precision) {
  SceneView view;
  view.camera = small_clip(20, 16, 100).camera;
  view.background = {0.2, 0.5, 0.1};
  view.precision = precision;
  return view;
}

std::vector<double> random_cotangent(const Camera& camera) {
  RandomSequence random(3);
  std::vector<double> cotangent(static_cast<std::size_t>(3 * camera.width * camera.height));
  for (double& number : cotangent) number = random.uniform(-1, 1);
  return cotangent;
}

double dot(const std::vector<double>& a, const std::vector<double>& b) {
  return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
}

}  // namespace

TEST_CASE("the adjoint of an image is that of its squared difference, for its cotangent") {
  const Gaussians scene = small_clip(20, 16, 100).scene;
  for (const Precision precision : {Precision::kFloat, Precision::kDouble, Precision::kReference}) {
    CAPTURE(static_cast<int>(precision));
    const SceneView view = view_in(precision);
    const std::vector<double> target = random_cotangent(view.camera);
    const SceneGradients squared = scene_gradients(scene, view, target);
    std::vector<double> cotangent = squared.rendered.image;
    for (std::size_t i = 0; i < cotangent.size(); ++i)
      cotangent[i] = 2 * (cotangent[i] - target[i]) / static_cast<double>(cotangent.size());
    const ImageAdjoint adjoint = image_adjoint(scene, view, cotangent);
    CHECK(adjoint.numbers.means == squared.means);
    CHECK(adjoint.numbers.sh == squared.sh);
    CHECK(adjoint.numbers.camera == squared.camera);
    CHECK(adjoint.numbers.loss == Approx(dot(cotangent, squared.rendered.image)));
  }
}

TEST_CASE("the image is linear in the background, whose gradient is the difference") {
  const Gaussians scene = small_clip(20, 16, 100).scene;
  for (const Precision precision : {Precision::kFloat, Precision::kDouble, Precision::kReference}) {
    CAPTURE(static_cast<int>(precision));
    SceneView view = view_in(precision);
    const std::vector<double> cotangent = random_cotangent(view.camera);
    const ImageAdjoint adjoint = image_adjoint(scene, view, cotangent);
    for (std::size_t c = 0; c < 3; ++c) {
      SceneView brighter = view;
      brighter.background[c] += 1;
      const double difference = dot(render_scene({scene, {}}, brighter).image, cotangent) -
                                dot(render_scene({scene, {}}, view).image, cotangent);
      CHECK(adjoint.background[c] == Approx(difference).epsilon(precision == Precision::kFloat ? 1e-4 : 1e-10));
    }
  }
}

TEST_CASE("a cotangent of another size is refused") {
  const std::vector<double> few(12);
  CHECK_THROWS_AS(image_adjoint(small_clip(20, 16, 100).scene, view_in(Precision::kDouble), few), InternalError);
}

}  // namespace image_cotangent_test
