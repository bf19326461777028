// Images of the brute-force renderer against numbers worked out by hand, against the textbook's form of the formulas,
// and against themselves: mirrored, cropped, split, scaled, moved.
#include "splat/reference.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/random.h"
#include "splat/reference_gaussian.h"
#include "tests/support/splat_scenes.h"

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

RenderSettings uncut(RenderSettings settings = {}) {
  apply_quality(settings, Quality::kReference);
  return settings;
}

template <class T = double>
reference::Image<T> render(const SplatScene& scene, const RenderSettings& settings) {
  return reference::render(reference_scene<T>(scene), reference_pinhole<T>(scene.camera),
                           reference_background<T>(scene), settings);
}

std::vector<reference::Fragment<double>> fragments(const SplatScene& scene, const RenderSettings& settings, int row,
                                                   int column) {
  return reference::fragments(reference_scene<double>(scene), reference_pinhole<double>(scene.camera), settings, row,
                              column);
}

template <class A, class B>
long double largest_difference(const A& a, const B& b) {
  REQUIRE(a.size() == b.size());
  long double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    REQUIRE(std::isfinite(a[i]));
    largest = std::max(largest, std::abs(static_cast<long double>(a[i]) - static_cast<long double>(b[i])));
  }
  return largest;
}

/// Largest difference of colours and transmittances.
template <class T, class U>
long double difference(const reference::Image<T>& a, const reference::Image<U>& b) {
  return std::max(largest_difference(a.color, b.color), largest_difference(a.transmittance, b.transmittance));
}

/// 5 × 5 pixels; a Gaussian at (0, 0, z) is centred on pixel (2, 2).
SplatScene small() {
  SplatScene scene;
  scene.camera = plain_camera({5, 5});
  scene.background = {0.25f, 0.5f, 1};
  return scene;
}

double logit(double opacity) { return std::log(opacity / (1 - opacity)); }

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

TEST_CASE("reference: Gaussians over each other, in depth order whatever their rows; opacity of groups") {
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
                                    scene.settings, row, column))
            alpha[static_cast<std::size_t>(fragment.gaussian)] = fragment.alpha;
          for (std::size_t n = 0; n < alpha.size(); ++n) {
            const long double expected = std::max(0.0L, textbook_alpha(scene, n, row, column));
            worst = std::max(worst, std::abs(alpha[n] - expected));
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
    return reference::fragments(gaussians, camera, settings, 2, 2)[0].gaussian;
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
        if (!reference::fragments(gaussians, reference_pinhole<double>(scene.camera), settings, row, column).empty()) {
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
