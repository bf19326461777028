// The graph of a reconstruction against the brute-force renderer, which shares no code with it.
#include "pipelines/scan/scan_graph.h"

#include <cmath>
#include <map>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "pipelines/scan/exposure.h"
#include "tests/support/taped_splats.h"

namespace scan_graph_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

/// Of float renders: a few pixels may flip a cut.
constexpr double kTolerance = 2e-4;

/// What a picture's camera sees; the picture itself has no part in what is compared.
Photo photo_of(const Camera& camera) {
  Photo photo;
  photo.color = Image(3, camera.height, camera.width);
  photo.camera = camera;
  return photo;
}

/// Elsewhere than the scene's, with another lens: the graph is recorded with that one and shown the picture of this.
Camera recorded_camera(Camera camera) {
  camera.fx *= 1.2;
  camera.cy -= 3;
  camera.camera_from_world =
      compose(se3_exp((Vector6<double>() << 0.05, -0.02, 0.1, 0.03, 0.02, -0.04).finished()), camera.camera_from_world);
  return camera;
}

std::map<std::string, std::vector<double>> gradients_of(const ScanGraph& graph, Tape<float>& tape) {
  std::map<std::string, std::vector<double>> all;
  for (const ParameterGroup<float>& group : graph.groups())
    all[group.name] = numbers_of<float>(tape.gradient(group.blocks.front()));
  return all;
}

void check_groups(const std::map<std::string, std::vector<double>>& computed, const ReferenceResult& expected) {
  for (const NamedNumbers& of : expected.gradients) {
    if (of.name == "camera" || of.name == "background") continue;
    INFO(of.name);
    REQUIRE(computed.at(of.name).size() == of.numbers.size());
    CHECK(relative_l2(computed.at(of.name), of.numbers) <= kTolerance);
  }
}

}  // namespace

TEST_CASE("a picture's loss moves means, shapes, opacities and harmonics as the brute-force renderer says") {
  SplatScene scene = random_splats(40, 7);
  scene.background = {0.3F, 0.6F, 0.1F};
  const SplatCotangent cotangent{random_cotangent(3 * Index(scene.camera.width) * scene.camera.height, 11), {}, {}, {}};
  const ReferenceResult expected = reference_result(scene, cotangent);

  ScanGraph graph(scene.gaussians(), recorded_camera(scene.camera), scene.settings, scene.sh_degree);
  graph.show(photo_of(scene.camera), {0.3F, 0.6F, 0.1F});
  Tape<float>& tape = graph.tape();
  tape.forward(graph.inputs().rendered);
  tape.backward(graph.inputs().rendered, std::vector<float>(cotangent.image.begin(), cotangent.image.end()));

  CHECK(relative_l2(numbers_of<float>(tape.value(graph.inputs().rendered)), expected.image) <= kTolerance);
  check_groups(gradients_of(graph, tape), expected);
}

TEST_CASE("exposures have the gradients of y = c exp(g) + o, and pass them on to the Gaussians") {
  SplatScene scene = random_splats(40, 8);
  scene.background = {0, 0, 0};
  const Index pixels = Index(scene.camera.width) * scene.camera.height;
  const std::vector<double> w = random_cotangent(3 * pixels, 12);
  const std::vector<float> exposure = {0.3F, -0.2F, 0.1F, 0.05F, -0.03F, 0.02F};

  SplatCotangent of_render;  // dL/dc and dL/dT of L = Σ w (c exp(g) + (1 − T) o)
  of_render.transmittance.assign(static_cast<std::size_t>(pixels), 0);
  for (std::size_t i = 0; i < w.size(); ++i) {
    const std::size_t channel = i / static_cast<std::size_t>(pixels), pixel = i % static_cast<std::size_t>(pixels);
    of_render.image.push_back(w[i] * std::exp(static_cast<double>(exposure[channel])));
    of_render.transmittance[pixel] -= w[i] * static_cast<double>(exposure[3 + channel]);
  }
  const ReferenceResult expected = reference_result(scene, of_render);
  std::vector<double> of_exposure(kExposureNumbers, 0.0);
  for (std::size_t i = 0; i < w.size(); ++i) {
    const std::size_t channel = i / static_cast<std::size_t>(pixels), pixel = i % static_cast<std::size_t>(pixels);
    of_exposure[channel] += of_render.image[i] * expected.image[i];
    of_exposure[3 + channel] += w[i] * (1 - expected.transmittance[pixel]);
  }

  ScanGraph graph(scene.gaussians(), scene.camera, scene.settings, scene.sh_degree, {.exposure = true});
  graph.show(photo_of(scene.camera), Vector3<double>::Zero());
  graph.set_exposure(exposure);
  Tape<float>& tape = graph.tape();
  tape.forward(graph.inputs().rendered);
  tape.backward(graph.inputs().rendered, std::vector<float>(w.begin(), w.end()));

  check_groups(gradients_of(graph, tape), expected);
  CHECK(relative_l2(numbers_of<float>(tape.gradient(graph.exposure())), of_exposure) <= kTolerance);
}

}  // namespace scan_graph_test
