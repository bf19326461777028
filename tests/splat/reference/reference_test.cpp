// Images of the brute-force renderer against numbers worked out by hand and against the textbook's form of the
// formulas.
#include "splat/reference/reference.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/random.h"
#include "splat/reference/reference_gaussian.h"
#include "tests/support/measures.h"
#include "tests/support/reference_images.h"

namespace reference_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

/// 5 × 5 pixels; a Gaussian at (0, 0, z) is centred on pixel (2, 2).
SplatScene small() {
  SplatScene scene;
  scene.camera = plain_camera({5, 5});
  scene.background = {0.25f, 0.5f, 1};
  return scene;
}

/// α of an untransformed Gaussian at a pixel as the papers write it: cov = J W Σ Wᵀ Jᵀ + blur I with Σ = R S Sᵀ Rᵀ,
/// conic = cov⁻¹, exp(−½ (a dx² + 2 b dx dy + c dy²)). −1: culled.
long double textbook_alpha(const SplatScene& scene, std::size_t n, int row, int column) {
  using R = long double;
  using M = Eigen::Matrix<R, 3, 3>;
  using V = Eigen::Matrix<R, 3, 1>;
  const Camera& camera = scene.camera;
  const RenderSettings& settings = scene.settings;
  const M w = camera.camera_from_world.rotation.cast<R>();
  const V m(scene.means[3 * n], scene.means[3 * n + 1], scene.means[3 * n + 2]);
  const V p = w * m + camera.camera_from_world.translation.cast<R>();
  if (p[2] <= static_cast<R>(settings.near)) return -1;
  R q[4], length = 0;
  for (std::size_t k = 0; k < 4; ++k) length += static_cast<R>(scene.quats[4 * n + k]) * scene.quats[4 * n + k];
  for (std::size_t k = 0; k < 4; ++k) q[k] = scene.quats[4 * n + k] / std::sqrt(length);
  M k;  // R = I + 2 w K + 2 K²
  k << 0, -q[3], q[2], q[3], 0, -q[1], -q[2], q[1], 0;
  const M rotation = M::Identity() + 2 * q[0] * k + 2 * k * k;
  M squares = M::Zero();
  for (int i = 0; i < 3; ++i)
    squares(i, i) = std::exp(2 * static_cast<R>(scene.log_scales[3 * n + static_cast<std::size_t>(i)]));
  const M sigma = rotation * squares * rotation.transpose();
  const auto held = [&](R ratio, R focal, R principal, R size) {
    const R margin = (settings.frustum_clamp - 1) * size / (2 * focal);
    return std::min(std::max(ratio, -principal / focal - margin), (size - principal) / focal + margin);
  };
  const R fx = camera.fx, fy = camera.fy, z = p[2];
  const R hx = held(p[0] / z, fx, camera.cx, camera.width), hy = held(p[1] / z, fy, camera.cy, camera.height);
  Eigen::Matrix<R, 2, 3> j;
  j << fx / z, 0, -fx * hx / z, 0, fy / z, -fy * hy / z;
  const Eigen::Matrix<R, 2, 2> unblurred = j * w * sigma * w.transpose() * j.transpose();
  const R blur = settings.blur;
  const R a = unblurred(0, 0) + blur, b = unblurred(0, 1), c = unblurred(1, 1) + blur, det = a * c - b * b;
  const R dx = column + 0.5L - (fx * p[0] / z + camera.cx), dy = row + 0.5L - (fy * p[1] / z + camera.cy);
  const R s = (c * dx * dx - 2 * b * dx * dy + a * dy * dy) / det / 2;
  R opacity = 1 / (1 + std::exp(-static_cast<R>(scene.opacity_logits[n])));
  if (settings.antialias)
    opacity *= std::sqrt((unblurred(0, 0) * unblurred(1, 1) - unblurred(0, 1) * unblurred(1, 0)) / det);
  return opacity * std::exp(-s);
}

}  // namespace

TEST_CASE("reference: one Gaussian in front of the camera") {
  SplatScene scene = small();
  scene.add({0, 0, 2}, 0.5, logit(0.6), {0.9, 0.6, 0.1});
  const reference::Image<double> image = render(scene, uncut());
  const double variance = 1.25 * 1.25 + 0.3;  // (focal · scale / depth)² + blur
  for (int row = 0; row < 5; ++row)
    for (int column = 0; column < 5; ++column) {
      const double d2 = (row - 2) * (row - 2) + (column - 2) * (column - 2), alpha = 0.6 * std::exp(-d2 / 2 / variance);
      const auto pixel = static_cast<std::size_t>(5 * row + column);
      CHECK(image.transmittance[pixel] == Approx(1 - alpha).epsilon(1e-6));
      CHECK(image.depth_sum[pixel] == Approx(2 * alpha).epsilon(1e-6));
      CHECK(image.color[3 * pixel] == Approx(0.9 * alpha + 0.25 * (1 - alpha)).epsilon(1e-6));
      CHECK(image.color[3 * pixel + 1] == Approx(0.6 * alpha + 0.5 * (1 - alpha)).epsilon(1e-6));
      CHECK(image.color[3 * pixel + 2] == Approx(0.1 * alpha + 1 - alpha).epsilon(1e-6));
    }
}

TEST_CASE("reference: Gaussians over each other, in depth order whatever their rows, opacity of groups") {
  SplatScene scene = small();
  scene.add({0, 0, 3}, 0.5, logit(0.5), {0, 1, 0});
  scene.add({0, 0, 2}, 0.5, logit(0.25), {1, 0, 0});
  scene.add({0, 0, 4}, 0.5, logit(0.8), {0, 0, 1});
  reference::Scene<double> gaussians = reference_scene<double>(scene);
  gaussians.groups = {1, -1, 0};
  const reference::Image<double> image =
      reference::render(gaussians, reference_pinhole<double>(scene.camera), {0.25, 0.5, 1}, uncut());
  const double w[] = {0.25, 0.75 * 0.5, 0.75 * 0.5 * 0.8}, left = 0.75 * 0.5 * 0.2;
  CHECK(image.color[36] == Approx(w[0] + 0.25 * left).epsilon(1e-6));
  CHECK(image.color[37] == Approx(w[1] + 0.5 * left).epsilon(1e-6));
  CHECK(image.color[38] == Approx(w[2] + left).epsilon(1e-6));
  CHECK(image.depth_sum[12] == Approx(2 * w[0] + 3 * w[1] + 4 * w[2]).epsilon(1e-6));
  REQUIRE(image.group_opacity.size() == 50);
  CHECK(image.group_opacity[12] == Approx(w[2]).epsilon(1e-6));
  CHECK(image.group_opacity[25 + 12] == Approx(w[1]).epsilon(1e-6));
  const auto list = fragments(scene, uncut(), 2, 2);
  REQUIRE(list.size() == 3);
  CHECK((list[0].gaussian == 1 && list[1].gaussian == 0 && list[2].gaussian == 2));
  CHECK(list[2].transmittance == Approx(0.75 * 0.5).epsilon(1e-6));
}

TEST_CASE("reference: no Gaussian, or none that is seen, leaves exactly the background (B11)") {
  for (const int size : {1, 15, 16, 17}) {
    SplatScene scene = small();
    scene.camera = plain_camera({size, 1});
    for (const int behind : {0, 1}) {
      if (behind == 1) {
        scene.add({0, 0, -1}, 5, 3, {1, 1, 1});
        scene.add({0, 0, 0}, 5, 3, {1, 1, 1});
        scene.add({0.1, 0, kNear / 2}, 5, 3, {1, 1, 1});
      }
      const reference::Image<double> image = render(scene, uncut());
      const auto pixels = static_cast<std::size_t>(size);
      CHECK(image.transmittance == std::vector<double>(pixels, 1));
      CHECK(image.depth_sum == std::vector<double>(pixels, 0));
      for (std::size_t i = 0; i < pixels; ++i)
        CHECK((image.color[3 * i] == 0.25 && image.color[3 * i + 1] == 0.5 && image.color[3 * i + 2] == 1));
      reference::Image<double> cotangent = image;
      const reference::Gradients<double> g = reference::gradients(
          reference_scene<double>(scene), reference_pinhole<double>(scene.camera), {0.25, 0.5, 1}, uncut(), cotangent);
      CHECK(g.means == std::vector<double>(scene.means.size(), 0));
      CHECK(g.sh == std::vector<double>(scene.sh.size(), 0));
      CHECK(g.camera == std::array<double, 6>{});
      CHECK(g.background == std::array<double, 3>{0.25 * size, 0.5 * size, 1. * size});
    }
  }
}

TEST_CASE("reference: depth equal to near is culled, the next number is not") {
  SplatScene scene = small();
  scene.settings.near = 0.25;
  scene.add({0, 0, 0.25}, 0.05, 0, {1, 0, 0});
  CHECK(fragments(scene, uncut(scene.settings), 2, 2).empty());
  scene.means[2] = std::nextafter(0.25f, 1.f);
  CHECK(fragments(scene, uncut(scene.settings), 2, 2).size() == 1);
}

TEST_CASE("reference: alpha agrees with the textbook's formulas") {
  for (SplatScene& scene : all_scenes(21))
    for (const bool antialias : {false, true}) {
      scene.settings = uncut(scene.settings);
      scene.settings.antialias = antialias;
      long double worst = 0;
      Index compared = 0;
      for (int row = 0; row < scene.camera.height; row += 3)
        for (int column = 0; column < scene.camera.width; column += 3) {
          std::vector<long double> alpha(static_cast<std::size_t>(scene.count()), 0);
          for (const auto& fragment :
               reference::fragments(reference_scene<long double>(scene), reference_pinhole<long double>(scene.camera),
                                    scene.settings, row, column)
                   .composited)
            alpha[static_cast<std::size_t>(fragment.gaussian)] = fragment.alpha;
          for (std::size_t n = 0; n < alpha.size(); ++n) {
            const long double expected = std::max(0.0L, textbook_alpha(scene, n, row, column));
            worst = larger(worst, std::abs(alpha[n] - expected));
            if (expected > 1e-3L) ++compared;
          }
        }
      INFO(scene.name << (antialias ? ", antialias: " : ": ") << worst << ", " << compared << " fragments");
      CHECK(compared > 20);
      CHECK(worst < 1e-12L);
    }
}

TEST_CASE("reference: needles keep their digits in double (A1, M3, M4)") {
  for (const double aspect : {1e2, 1e4, 1e6}) {
    const SplatScene scene = needles(20, aspect, 22);
    for (const double blur : {0.3, 1e-6}) {
      RenderSettings settings = uncut(scene.settings);
      settings.blur = blur;
      const long double error = difference(render<double>(scene, settings), render<long double>(scene, settings));
      INFO("aspect " << aspect << ", blur " << blur << ": " << error);
      CHECK(error < 1e-15L * std::min(1e4L, std::max(100.0L, static_cast<long double>(aspect))));
    }
  }
}

TEST_CASE("reference: the Gaussian that crosses the threshold is added, or not (B4)") {
  SplatScene scene = small();
  scene.add({0, 0, 2}, 0.5, logit(0.9001), {0, 0, 0});  // leaves T = 0.0999
  scene.add({0, 0, 3}, 0.5, logit(0.9995), {1, 0, 0});  // leaves T = 5e-5
  scene.add({0, 0, 4}, 0.5, logit(0.5), {0, 1, 0});
  const reference::Image<double> exact = render(scene, uncut());
  RenderSettings settings = uncut();
  settings.transmittance_stop = 1e-4;
  const reference::Image<double> inclusive = render(scene, settings);
  CHECK(std::abs(inclusive.color[36] - exact.color[36]) < 1.1e-4);
  CHECK(inclusive.color[36] == Approx(0.0999 * 0.9995 + 0.25 * 0.0999 * 0.0005).epsilon(1e-4));
  CHECK(fragments(scene, settings, 2, 2).size() == 2);
  settings.stop_rule = StopRule::kExclusive;
  const reference::Image<double> exclusive = render(scene, settings);
  CHECK(exclusive.color[36] == Approx(0.25 * 0.0999).epsilon(1e-4));
  CHECK(exclusive.transmittance[12] == Approx(0.0999).epsilon(1e-4));
  CHECK(fragments(scene, settings, 2, 2).size() == 1);
}

TEST_CASE("reference: a transmittance equal to the threshold") {
  SplatScene scene = small();
  scene.add({0, 0, 2}, 0.5, 0, {0, 0, 0});  // α = ½ exactly
  scene.add({0, 0, 3}, 0.5, 0, {1, 0, 0});
  RenderSettings settings = uncut();
  settings.transmittance_stop = 0.5;
  const auto count = [&](StopRule rule, StopWhen when) {
    settings.stop_rule = rule;
    settings.stop_when = when;
    return fragments(scene, settings, 2, 2).size();
  };
  CHECK(count(StopRule::kInclusive, StopWhen::kBelow) == 2);
  CHECK(count(StopRule::kInclusive, StopWhen::kAtOrBelow) == 1);
  CHECK(count(StopRule::kExclusive, StopWhen::kBelow) == 1);
  CHECK(count(StopRule::kExclusive, StopWhen::kAtOrBelow) == 0);
  // A threshold of 0 stops nothing, not even at T = 0.
  scene.opacity_logits[0] = 80;
  settings.transmittance_stop = 0;
  for (const StopRule rule : {StopRule::kInclusive, StopRule::kExclusive})
    CHECK(count(rule, StopWhen::kAtOrBelow) == 2);
}

TEST_CASE("reference: an opaque wall leaks 1 − cap (B16)") {
  SplatScene scene = small();
  scene.add({0, 0, 2}, 0.5, 40, {0, 0, 0});
  for (const double cap : {0.99, kAlphaCap, 1.}) {
    RenderSettings settings = uncut();
    settings.alpha_cap = cap;
    CHECK(render(scene, settings).transmittance[12] == 1 - cap);
  }
}

TEST_CASE("reference: what alpha_min leaves out (B5, M18)") {
  SplatScene scene = small();
  const double alpha = 0.0039;  // below 1/255
  for (int i = 0; i < 1000; ++i) scene.add({0, 0, 2 + 0.001 * i}, 0.5, logit(alpha), {1, 1, 1});
  CHECK(render(scene, RenderSettings()).transmittance[12] == 1);
  CHECK(render(scene, uncut()).transmittance[12] == Approx(std::pow(1 - alpha, 1000)).epsilon(1e-4));
  // At the threshold itself a Gaussian is drawn.
  scene = small();
  scene.add({0, 0, 2}, 0.5, 0, {1, 1, 1});
  RenderSettings settings = uncut();
  settings.alpha_min = 0.5;
  CHECK(fragments(scene, settings, 2, 2).size() == 1);
  settings.alpha_min = std::nextafter(0.5, 1.);
  CHECK(fragments(scene, settings, 2, 2).empty());
}

TEST_CASE("reference: ties go by row, and the type of the depth key decides what is a tie (B8)") {
  SplatScene scene = small();
  scene.add({0, 0, 2}, 0.5, 0, {1, 0, 0});
  scene.add({0, 0, 2}, 0.5, 0, {0, 1, 0});
  reference::Scene<double> gaussians = reference_scene<double>(scene);
  const reference::Pinhole<double> camera = reference_pinhole<double>(scene.camera);
  const auto first = [&](std::optional<DepthKey> key) {
    RenderSettings settings = uncut();
    settings.depth_key = key;
    return reference::fragments(gaussians, camera, settings, 2, 2).composited[0].gaussian;
  };
  CHECK(first(DepthKey::kDouble) == 0);
  gaussians.means[5] = 2 - 1e-12;
  CHECK(first(DepthKey::kDouble) == 1);
  CHECK(first(std::nullopt) == 1);
  CHECK(first(DepthKey::kFloat) == 0);
}

TEST_CASE("reference: INRIA's square support, by its tiles") {
  for (const auto& [u, begin, end] :
       {std::tuple{22.5, 0, 32}, {23., 0, 32}, {23.5, 16, 32}, {26., 16, 32}, {26.5, 16, 40}}) {
    // Variance 3.9: λ = 3.9 + √0.1, radius ceil(3 √λ) = 7 (6 without the 0.1), centre u − ½ in INRIA's pixels.
    SplatScene scene;
    scene.camera = plain_camera({40, 40});
    const double z = 40;
    scene.add({u - 20, 3.5, z}, std::sqrt(3.9), 0, {1, 0, 0});  // v = 23.5
    RenderSettings settings = uncut();
    settings.blur = 0;
    settings.footprint = Footprint::kSquare3Sigma;
    reference::Scene<double> gaussians = reference_scene<double>(scene);
    std::set<int> columns, rows;
    for (int row = 0; row < 40; ++row)
      for (int column = 0; column < 40; ++column)
        if (!reference::fragments(gaussians, reference_pinhole<double>(scene.camera), settings, row, column)
                 .composited.empty()) {
          columns.insert(column);
          rows.insert(row);
        }
    INFO("u = " << u);
    CHECK((*columns.begin() == begin && *columns.rbegin() == end - 1));
    CHECK(static_cast<int>(columns.size()) == end - begin);
    CHECK((*rows.begin() == 16 && *rows.rbegin() == 31));
  }
}

TEST_CASE("reference: spherical harmonics have INRIA's constants, order and signs") {
  const double c1 = 0.4886025119029199;
  const double c2[] = {1.0925484305920792, -1.0925484305920792, 0.31539156525252005, -1.0925484305920792,
                       0.5462742152960396};
  const double c3[] = {-0.5900435899266435, 2.890611442640554, -0.4570457994644658, 0.3731763325901154,
                       -0.4570457994644658, 1.445305721320277, -0.5900435899266435};
  RandomSequence draw(23);
  for (int repeat = 0; repeat < 10; ++repeat) {
    double x = draw.normal(), y = draw.normal(), z = draw.normal();
    const double length = std::sqrt(x * x + y * y + z * z), xx = x / length;
    const double yy = y / length, zz = z / length;
    x = xx, y = yy, z = zz;
    const double expected[] = {0.28209479177387814,
                               -c1 * y,
                               c1 * z,
                               -c1 * x,
                               c2[0] * x * y,
                               c2[1] * y * z,
                               c2[2] * (2 * z * z - x * x - y * y),
                               c2[3] * x * z,
                               c2[4] * (x * x - y * y),
                               c3[0] * y * (3 * x * x - y * y),
                               c3[1] * x * y * z,
                               c3[2] * y * (4 * z * z - x * x - y * y),
                               c3[3] * z * (2 * z * z - 3 * x * x - 3 * y * y),
                               c3[4] * x * (4 * z * z - x * x - y * y),
                               c3[5] * z * (x * x - y * y),
                               c3[6] * x * (x * x - 3 * y * y)};
    const std::array<double, 16> basis = reference::sh_basis(3, reference::Vec3<double>{x, y, z});
    for (std::size_t k = 0; k < 16; ++k) CHECK(basis[k] == Approx(expected[k]).epsilon(1e-14).margin(1e-15));
  }
}

TEST_CASE("reference: the colour is that of the direction from the camera's centre to the mean") {
  SplatScene scene = small();
  scene.sh_degree = 1;
  scene.camera.camera_from_world = look_at({0, -2, 0}, {0, 0, 0});  // looks along +y
  scene.add({0, 0, 0}, 0.5, 40, {0.5, 0.5, 0.5});
  scene.sh[3] = 0.5;    // −C1 y, red
  scene.sh[7] = 0.5;    // C1 z, green
  scene.sh[11] = -0.5;  // −C1 x, blue
  const reference::Image<double> image = render(scene, uncut());
  CHECK(image.color[36] == Approx(0.5 - 0.5 * 0.4886025119029199).epsilon(1e-12));
  CHECK(image.color[37] == Approx(0.5).epsilon(1e-12));
  CHECK(image.color[38] == Approx(0.5).epsilon(1e-12));
  RenderSettings settings = uncut();
  settings.sh_degree = 0;
  CHECK(render(scene, settings).color[36] == Approx(0.5).epsilon(1e-12));
}

TEST_CASE("reference: sizes that contradict each other are refused") {
  const SplatScene scene = random_splats(3, 31);
  const reference::Pinhole<double> camera = reference_pinhole<double>(scene.camera);
  reference::Scene<double> bad = reference_scene<double>(scene);
  bad.quats.pop_back();
  CHECK_THROWS_WITH(reference::render(bad, camera, {0, 0, 0}, uncut()), Catch::Contains("quats.size()"));
  bad = reference_scene<double>(scene);
  bad.sh_coefficients = 5;
  CHECK_THROWS_WITH(reference::render(bad, camera, {0, 0, 0}, uncut()), Catch::Contains("5 coefficients"));
  const reference::Scene<double> good = reference_scene<double>(scene);
  reference::Image<double> cotangent;
  cotangent.color.resize(7);
  CHECK_THROWS_WITH(reference::gradients(good, camera, {0, 0, 0}, uncut(), cotangent), Catch::Contains("color: 7"));
  reference::Pinhole<double> flat = camera;
  flat.height = 0;
  CHECK_THROWS_AS(reference::render(good, flat, {0, 0, 0}, uncut()), InternalError);
  CHECK_THROWS_AS(reference::fragments(good, camera, uncut(), 0, camera.width), InternalError);
}

}  // namespace reference_test
