// Images of the brute-force renderer against themselves (mirrored, cropped, split, moved) and against long double.
#include <cmath>

#include <catch2/catch.hpp>

#include "tests/support/reference_images.h"

namespace reference_symmetry_test {

using namespace hsi4d;
using namespace hsi4d::test;

TEST_CASE("reference: a mirrored scene gives the mirrored image (B20)") {
  SplatScene scene = random_splats(30, 24);
  scene.camera = plain_camera({24, 17});
  scene.camera.cx = 9.25;
  for (std::size_t i = 2; i < scene.means.size(); i += 3) scene.means[i] += 3;
  SplatScene mirrored = scene;
  mirrored.camera.cx = 24 - scene.camera.cx;
  for (std::size_t i = 0; i < static_cast<std::size_t>(scene.count()); ++i) {
    mirrored.means[3 * i] *= -1;
    mirrored.quats[4 * i + 2] *= -1;
    mirrored.quats[4 * i + 3] *= -1;
    for (const std::size_t k : {3, 4, 7, 10, 13, 15})  // odd in x
      for (std::size_t c = 0; c < 3; ++c) mirrored.sh[3 * (16 * i + k) + c] *= -1;
  }
  const reference::Image<double> a = render(scene, uncut()), b = render(mirrored, uncut());
  for (std::size_t row = 0; row < 17; ++row)
    for (std::size_t column = 0; column < 24; ++column)
      for (std::size_t c = 0; c < 3; ++c)
        REQUIRE(b.color[3 * (24 * row + 23 - column) + c] ==
                Approx(a.color[3 * (24 * row + column) + c]).epsilon(1e-13));
}

TEST_CASE("reference: the crop of a render is the render of the crop (A3)") {
  SplatScene scene = off_centre(30, 25);
  RenderSettings settings = uncut();
  settings.frustum_clamp = 100;
  const reference::Image<double> whole = render(scene, settings);
  const int left = 7, top = 11, width = 20, height = 9;
  const int full = scene.camera.width;
  scene.camera = cropped(scene.camera, left, top, width, height);
  const reference::Image<double> part = render(scene, settings);
  for (int row = 0; row < height; ++row)
    for (int column = 0; column < 3 * width; ++column)
      REQUIRE(part.color[static_cast<std::size_t>(3 * width * row + column)] ==
              Approx(whole.color[static_cast<std::size_t>(3 * (full * (row + top) + left) + column)]).epsilon(1e-13));
}

TEST_CASE("reference: a Gaussian split in two at the same place looks the same") {
  const SplatScene scene = random_splats(20, 26);
  reference::Scene<double> whole = reference_scene<double>(scene);
  reference::Scene<double> split = whole;
  split.n = 2 * whole.n;
  for (auto array : {&reference::Scene<double>::means, &reference::Scene<double>::quats,
                     &reference::Scene<double>::log_scales, &reference::Scene<double>::sh})
    (split.*array).insert((split.*array).end(), (whole.*array).begin(), (whole.*array).end());
  split.opacity_logits.clear();
  // 1 − (1 − a)(1 − b) composes only where G = 1: so wide Gaussians, whose G is 1 all over the image.
  for (double& x : split.log_scales) x = 18;
  for (double& x : whole.log_scales) x = 18;
  for (int half = 0; half < 2; ++half)
    for (const double x : whole.opacity_logits) {
      const double a = 1 / (1 + std::exp(-x)), share = half == 0 ? 0.3 : 0.7;
      split.opacity_logits.push_back(logit(-std::expm1(share * std::log1p(-a))));
    }
  const reference::Pinhole<double> camera = reference_pinhole<double>(scene.camera);
  const auto a = reference::render(whole, camera, {1, 0, 0.5}, uncut());
  const auto b = reference::render(split, camera, {1, 0, 0.5}, uncut());
  CHECK(difference(a, b) < 1e-12L);
}

TEST_CASE("reference: a render does not depend on the unit of length (A8) or on where the world's origin lies (A10)") {
  const SplatScene scene = random_splats(20, 27);
  const reference::Image<double> image = render(scene, uncut());
  for (const double factor : {1e-3, 1e3}) {
    reference::Scene<double> scaled = reference_scene<double>(scene);
    reference::Pinhole<double> camera = reference_pinhole<double>(scene.camera);
    for (double& x : scaled.means) x *= factor;
    for (double& x : scaled.log_scales) x += std::log(factor);
    for (const std::size_t i : {3, 7, 11}) camera.camera_from_world[i] *= factor;
    RenderSettings settings = uncut();
    settings.near *= factor;
    CHECK(difference(reference::render(scaled, camera, reference_background<double>(scene), settings), image) < 1e-12L);
  }
  for (const double offset : {1e2, 1e4, 1e6}) {
    reference::Scene<double> far = reference_scene<double>(scene);
    reference::Pinhole<double> camera = reference_pinhole<double>(scene.camera);
    for (double& x : far.means) x += offset;
    for (const std::size_t r : {0, 4, 8})
      for (const std::size_t k : {0, 1, 2}) camera.camera_from_world[r + 3] -= camera.camera_from_world[r + k] * offset;
    CHECK(difference(reference::render(far, camera, reference_background<double>(scene), uncut()), image) <
          1e-13L * offset);
  }
}

TEST_CASE("reference: transforms move means and axes") {
  SplatScene scene = random_splats(10, 28);
  scene.sh_degree = 0;  // a moved Gaussian is seen from another direction
  std::vector<float> constant;
  for (std::size_t i = 0; i < scene.sh.size(); i += 48) constant.insert(constant.end(), &scene.sh[i], &scene.sh[i] + 3);
  scene.sh = constant;
  reference::Scene<double> moved = reference_scene<double>(scene);
  for (Index i = 0; i < moved.n; ++i)  // a quarter turn about z, twice the size, and a shift
    moved.transforms.insert(moved.transforms.end(), {0, -2, 0, 0.25, 2, 0, 0, -0.5, 0, 0, 2, 0.125});
  reference::Scene<double> by_hand = reference_scene<double>(scene);
  const double h = std::sqrt(0.5);
  for (std::size_t i = 0; i < static_cast<std::size_t>(moved.n); ++i) {
    double* m = &by_hand.means[3 * i];
    const double x = m[0];
    m[0] = -2 * m[1] + 0.25;
    m[1] = 2 * x - 0.5;
    m[2] = 2 * m[2] + 0.125;
    double* q = &by_hand.quats[4 * i];  // (h, 0, 0, h) q
    const double w = q[0], qx = q[1], qy = q[2], qz = q[3];
    q[0] = h * (w - qz);
    q[1] = h * (qx - qy);
    q[2] = h * (qy + qx);
    q[3] = h * (qz + w);
    for (std::size_t k = 0; k < 3; ++k) by_hand.log_scales[3 * i + k] += std::log(2.);
  }
  const reference::Pinhole<double> camera = reference_pinhole<double>(scene.camera);
  CHECK(difference(reference::render(moved, camera, {1, 0, 0.5}, uncut()),
                   reference::render(by_hand, camera, {1, 0, 0.5}, uncut())) < 1e-12L);
}

TEST_CASE("reference: quaternions of any length render alike (A13)") {
  const SplatScene scene = raw_quaternions(20, 29);
  SplatScene unit = scene;
  for (std::size_t i = 0; i < unit.quats.size(); i += 4) {
    double length = 0;
    for (std::size_t k = i; k < i + 4; ++k) length += double(unit.quats[k]) * unit.quats[k];
    for (std::size_t k = i; k < i + 4; ++k) unit.quats[k] = static_cast<float>(unit.quats[k] / std::sqrt(length));
  }
  CHECK(difference(render(scene, uncut()), render(unit, uncut())) < 1e-5L);
}

TEST_CASE("reference: with antialias a small Gaussian keeps its weight (A9)") {
  for (const double scale_px : {0.01, 0.1, 0.5}) {
    SplatScene scene;
    scene.camera = plain_camera({32, 32});
    scene.add({0.01, -0.02, 1}, scale_px / 32, logit(0.8), {1, 1, 1});
    RenderSettings settings = uncut();
    settings.antialias = true;
    double sum = 0;
    for (const double t : render(scene, settings).transmittance) sum += 1 - t;
    CHECK(sum == Approx(0.8 * 2 * 3.14159265 * scale_px * scale_px).epsilon(0.01));
  }
}

TEST_CASE("reference: double agrees with long double, and weights and transmittance sum to 1") {
  for (const SplatScene& scene : all_scenes(30)) {
    const RenderSettings settings = uncut(scene.settings);
    const long double error = difference(render<double>(scene, settings), render<long double>(scene, settings));
    INFO(scene.name << ": " << error);
    CHECK(error < (scene.name == "needles" ? 1e-12L : 1e-13L));
    double sum = 0;
    const auto list = fragments(scene, settings, 15, 20);
    for (const auto& fragment : list) sum += fragment.alpha * fragment.transmittance;
    const double behind = list.empty() ? 1 : list.back().transmittance * (1 - list.back().alpha);
    CHECK(sum + behind == Approx(1).epsilon(1e-14));
  }
}

}  // namespace reference_symmetry_test
