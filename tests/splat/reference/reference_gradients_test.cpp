// Gradients of the brute-force renderer against central differences of itself in long double, and at its branches.
#include <cmath>
#include <functional>

#include <catch2/catch.hpp>

#include "core/random.h"
#include "splat/reference/reference.h"
#include "tests/support/splat_scenes.h"

namespace reference_gradients_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {
using Real = long double;

/// Everything that a render depends on.
template <class T>
struct Inputs {
  reference::Scene<T> scene;
  reference::Pinhole<T> camera;
  std::array<T, 3> background{};
  RenderSettings settings;

  reference::Image<T> render() const { return reference::render(scene, camera, background, settings); }
  reference::Gradients<T> gradients(const reference::Image<T>& cotangent) const {
    return reference::gradients(scene, camera, background, settings, cotangent);
  }
};

template <class T>
Inputs<T> inputs_of(const SplatScene& scene, Quality quality = Quality::kReference) {
  Inputs<T> in{reference_scene<T>(scene), reference_pinhole<T>(scene.camera), reference_background<T>(scene),
               scene.settings};
  apply_quality(in.settings, quality);
  return in;
}

template <class T>
reference::Image<T> random_cotangent(const reference::Image<T>& image, std::uint64_t seed) {
  RandomSequence draw(seed, random_stream("cotangent"));
  reference::Image<T> cotangent = image;
  for (std::vector<T>* array :
       {&cotangent.color, &cotangent.transmittance, &cotangent.depth_sum, &cotangent.group_opacity})
    for (T& x : *array) x = draw.uniform(-1, 1);
  return cotangent;
}

template <class T>
T inner(const std::vector<T>& a, const std::vector<T>& b) {
  T sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum;
}

Real loss(const Inputs<Real>& in, const reference::Image<Real>& cotangent) {
  const reference::Image<Real> image = in.render();
  return inner(image.color, cotangent.color) + inner(image.transmittance, cotangent.transmittance) +
         inner(image.depth_sum, cotangent.depth_sum) + inner(image.group_opacity, cotangent.group_opacity);
}

/// Exp(ξ) T for ξ with one entry other than 0.
void move_camera(reference::Pinhole<Real>& camera, std::size_t entry, Real by) {
  auto& m = camera.camera_from_world;
  if (entry < 3) {
    m[4 * entry + 3] += by;
    return;
  }
  const std::size_t row1 = 4 * ((entry + 1) % 3), row2 = 4 * ((entry + 2) % 3);  // about the axis of row entry − 3
  for (std::size_t k = 0; k < 4; ++k) {
    const Real a = m[row1 + k], b = m[row2 + k];
    m[row1 + k] = std::cos(by) * a - std::sin(by) * b;
    m[row2 + k] = std::sin(by) * a + std::cos(by) * b;
  }
}

/// Derivative of f at 0 by differences of fourth order.
Real difference(const std::function<Real(Real)>& f, Real h) {
  return (8 * (f(h) - f(-h)) - (f(2 * h) - f(-2 * h))) / (12 * h);
}

// The error of fourth order and what rounding of a loss of about 10 leaves of it are then both below 1e-13 here.
constexpr Real kStep = 2e-5L, kRounding = 1e-13L;

/// Checks every entry of one class of inputs: relative to itself, or to a hundredth of the class's largest.
void check_class(const std::string& name, const Real* gradient, std::size_t size,
                 const std::function<Real(std::size_t, Real)>& loss_moved, Real tolerance) {
  std::vector<Real> expected(size);
  Real largest = 0;
  for (std::size_t i = 0; i < size; ++i) {
    expected[i] = difference([&](Real by) { return loss_moved(i, by); }, kStep);
    largest = std::max(largest, std::abs(expected[i]));
  }
  for (std::size_t i = 0; i < size; ++i) {
    INFO(name << " entry " << i << ": " << gradient[i] << " against " << expected[i]);
    REQUIRE(std::abs(gradient[i] - expected[i]) <=
            tolerance * std::max(std::abs(expected[i]), largest / 100) + kRounding);
  }
}

void check_gradients(const std::string& name, const Inputs<Real>& in, Real tolerance = 1e-9L) {
  INFO(name);
  const reference::Image<Real> cotangent = random_cotangent(in.render(), 5);
  const reference::Gradients<Real> g = in.gradients(cotangent);
  using Arrays = std::vector<Real> reference::Scene<Real>::*;
  const auto check = [&](const char* what, Arrays array, const std::vector<Real>& gradient) {
    REQUIRE(gradient.size() == (in.scene.*array).size());
    const auto moved = [&](std::size_t i, Real by) {
      Inputs<Real> other = in;
      (other.scene.*array)[i] += by;
      return loss(other, cotangent);
    };
    check_class(what, gradient.data(), gradient.size(), moved, tolerance);
  };
  check("means", &reference::Scene<Real>::means, g.means);
  check("quats", &reference::Scene<Real>::quats, g.quats);
  check("log_scales", &reference::Scene<Real>::log_scales, g.log_scales);
  check("opacity_logits", &reference::Scene<Real>::opacity_logits, g.opacity_logits);
  check("sh", &reference::Scene<Real>::sh, g.sh);
  check("transforms", &reference::Scene<Real>::transforms, g.transforms);
  const auto camera_moved = [&](std::size_t i, Real by) {
    Inputs<Real> other = in;
    move_camera(other.camera, i, by);
    return loss(other, cotangent);
  };
  check_class("camera", g.camera.data(), 6, camera_moved, tolerance);
  const auto background_moved = [&](std::size_t i, Real by) {
    Inputs<Real> other = in;
    other.background[i] += by;
    return loss(other, cotangent);
  };
  check_class("background", g.background.data(), 3, background_moved, tolerance);
}

constexpr SceneSize kSmall = {9, 7};

/// A transform of general linear part for every Gaussian, and groups −1, 0, 1.
void add_transforms(Inputs<Real>& in, std::uint64_t seed) {
  RandomSequence draw(seed, random_stream("transforms"));
  for (Index i = 0; i < in.scene.n; ++i) {
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 4; ++c) in.scene.transforms.push_back((r == c ? 1 : 0) + draw.uniform(-0.2, 0.2));
    in.scene.groups.push_back(static_cast<int>(i % 3) - 1);
  }
}

template <class T>
T norm(const std::vector<T>& x) {
  return std::sqrt(inner(x, x));
}

/// |a − b| / |b| in L2; a is double.
Real relative_l2(const std::vector<double>& a, const std::vector<Real>& b) {
  REQUIRE(a.size() == b.size());
  std::vector<Real> difference(b.size());
  for (std::size_t i = 0; i < b.size(); ++i) difference[i] = a[i] - b[i];
  const Real size = norm(b);
  return size > 0 ? norm(difference) / size : norm(difference);
}

/// Largest relative L2 error of any class of gradients.
Real gradient_error(const reference::Gradients<double>& a, const reference::Gradients<Real>& b) {
  const std::vector<double> camera(a.camera.begin(), a.camera.end()), bg(a.background.begin(), a.background.end());
  return std::max({relative_l2(a.means, b.means), relative_l2(a.quats, b.quats),
                   relative_l2(a.log_scales, b.log_scales), relative_l2(a.opacity_logits, b.opacity_logits),
                   relative_l2(a.sh, b.sh), relative_l2(camera, std::vector<Real>(b.camera.begin(), b.camera.end())),
                   relative_l2(bg, std::vector<Real>(b.background.begin(), b.background.end()))});
}

/// One Gaussian straight ahead at 2 m: its centre is that of pixel (2, 2), where α = its opacity.
SplatScene single(double logit) {
  SplatScene scene;
  scene.camera = plain_camera({5, 5});
  scene.background = {0.25f, 0.5f, 1};
  scene.add({0, 0, 2}, 0.5, logit, {0.9, 0.6, 0.1});
  return scene;
}

/// Cotangent 1 for the red channel of one pixel.
template <class T>
reference::Image<T> red_of(const Inputs<T>& in, int row, int column) {
  reference::Image<T> cotangent;
  cotangent.color.resize(static_cast<std::size_t>(3 * in.camera.width * in.camera.height));
  cotangent.color[static_cast<std::size_t>(3 * (row * in.camera.width + column))] = 1;
  return cotangent;
}

bool all_zero(const std::vector<double>& x) {
  return std::all_of(x.begin(), x.end(), [](double v) { return v == 0; });
}
bool all_finite(const std::vector<double>& x) {
  return std::all_of(x.begin(), x.end(), [](double v) { return std::isfinite(v); });
}
}  // namespace

TEST_CASE("reference: every class of gradients agrees with differences") {
  for (const std::uint64_t seed : {1u, 2u, 3u})
    check_gradients("random", inputs_of<Real>(random_splats(5, seed, kSmall)));
  check_gradients("off centre", inputs_of<Real>(off_centre(5, 4, kSmall)));
  check_gradients("needles", inputs_of<Real>(needles(4, 30, 5, kSmall)));
  Inputs<Real> moved = inputs_of<Real>(random_splats(5, 6, kSmall));
  add_transforms(moved, 6);
  check_gradients("transforms, groups", moved);
  moved.settings.antialias = true;
  check_gradients("transforms, antialias", moved);
  moved.settings.antialias = false;
  moved.settings.sh_degree = 1;
  moved.settings.blur = 0;
  check_gradients("degree 1 of 3, no blur", moved);
}

TEST_CASE("reference: gradients agree with differences where Gaussians are cut and pixels stop") {
  for (const Compatibility compatibility : {Compatibility::kNone, Compatibility::kGsplat, Compatibility::kInria}) {
    Inputs<Real> in = inputs_of<Real>(random_splats(8, 9, kSmall));
    for (Real& x : in.scene.opacity_logits) x = std::min(x + 2, 4.0L);  // below the caps
    apply_compatibility(in.settings, compatibility);
    in.settings.alpha_min = 0.02;
    in.settings.transmittance_stop = 0.1;
    Inputs<Real> whole = in;
    whole.settings.transmittance_stop = 0;
    REQUIRE(whole.render().transmittance != in.render().transmittance);
    check_gradients("cut and stopped", in);
  }
}

TEST_CASE("reference: gradients of quaternions of any length agree with differences") {
  SplatScene scene = random_splats(4, 7, kSmall);
  for (std::size_t i = 0; i < 8; ++i) scene.quats[i] *= i < 4 ? 3.f : 0.25f;
  check_gradients("raw quaternions", inputs_of<Real>(scene));
}

TEST_CASE("reference: the gradient of the camera is right for a rotation that is not orthonormal") {
  Inputs<Real> in = inputs_of<Real>(random_splats(4, 8, kSmall));
  RandomSequence draw(8);
  for (Real& x : in.camera.camera_from_world) x += draw.uniform(-0.01, 0.01);
  check_gradients("skewed camera", in);
}

TEST_CASE("reference: gradients at, within and beyond the clamp of the Jacobian (A2)") {
  for (const double principal : {0.5, 0.2})
    for (const double times : {0., 0.99, 1.01, 3.})
      for (const double sign : {-1., 1.})
        for (const bool vertical : {false, true}) {
          SplatScene scene;
          scene.sh_degree = 1;
          scene.camera = plain_camera({10, 8});
          scene.camera.cx = principal * 10;
          scene.camera.cy = (1 - principal) * 8;
          const double size = vertical ? 8 : 10, c = vertical ? scene.camera.cy : scene.camera.cx;
          const double margin = 0.3 * size / 2;  // pixels; the focal length is 10
          const double limit = (sign < 0 ? -c - margin : size - c + margin) / 10;
          const double z = 1.7, at = times * limit * z;
          scene.add({vertical ? 0.1 : at, vertical ? at : 0.1, z}, 0.3 + 0.5 * times, 0.4, {0.8, 0.5, 0.3});
          scene.quats = {0.9f, 0.2f, -0.3f, 0.5f};
          scene.log_scales[1] -= 0.7f;
          INFO("x/z at " << times << " of the limit " << limit << (vertical ? ", vertical" : ""));
          const Inputs<Real> in = inputs_of<Real>(scene);
          const std::vector<Real> means = in.gradients(random_cotangent(in.render(), 5)).means;
          REQUIRE(norm(means) > 1e-6L);
          check_gradients("clamp", in, 1e-8L);
        }
}

TEST_CASE("reference: gradients are those of double to many digits, opaque Gaussians included (B2)") {
  for (const SplatScene& scene : all_scenes(11)) {
    const Inputs<double> in = inputs_of<double>(scene);
    const Inputs<Real> exact = inputs_of<Real>(scene);
    const reference::Image<double> cotangent = random_cotangent(in.render(), 3);
    const Real error = gradient_error(in.gradients(cotangent), exact.gradients(random_cotangent(exact.render(), 3)));
    INFO(scene.name << ": " << error);
    CHECK(error < (scene.name == "needles" ? 1e-10L : 1e-11L));
  }
  for (const double alpha : {0.6, 1 - 1e-7, 1.}) {
    const SplatScene scene = stack(12, alpha, 12, {8, 8});
    const Inputs<double> in = inputs_of<double>(scene);
    const Inputs<Real> exact = inputs_of<Real>(scene);
    const reference::Gradients<double> g = in.gradients(random_cotangent(in.render(), 3));
    INFO("stack of " << alpha);
    CHECK(all_finite(g.opacity_logits));
    CHECK(gradient_error(g, exact.gradients(random_cotangent(exact.render(), 3))) < 1e-11L);
  }
}

TEST_CASE("reference: nothing flows to opacity and shape where the cap holds (B3)") {
  SplatScene scene = single(0);
  scene.means[0] = 0.0625;  // x/z = 1/32: 5/32 pixel beside the centre of pixel (2, 2)
  const double variance = 1.25 * 1.25 * (1 + 1 / 1024.) + kBlur, g = std::exp(-25 / 2048. / variance);
  for (const double logit : {4., 10., 40.}) {  // o G = 0.976, 0.993, 0.993
    scene.opacity_logits[0] = static_cast<float>(logit);
    Inputs<double> in = inputs_of<double>(scene);
    in.settings.alpha_cap = kAlphaCapCompatible;
    const reference::Gradients<double> zero = in.gradients(red_of(in, 2, 2));
    const bool held = logit > 5;
    INFO("logit " << logit);
    CHECK((zero.opacity_logits[0] == 0) == held);
    CHECK(all_zero(zero.means) == held);
    CHECK(all_zero(zero.log_scales) == held);
    CHECK(zero.sh[0] != 0);
    // Passed: as if α = o G, T in front 1, background behind. do/dlogit = o (1 − o) = e/(1+e)².
    in.settings.cap_gradient = CapGradient::kPass;
    const double e = std::exp(-logit);
    const reference::Gradients<double> passed = in.gradients(red_of(in, 2, 2));
    CHECK(passed.opacity_logits[0] == Approx((0.9 - 0.25) * g * e / ((1 + e) * (1 + e))).epsilon(1e-6));
    CHECK(passed.means[0] != 0);
  }
  // Just below the cap differences agree.
  Inputs<Real> in = inputs_of<Real>(single(4));
  in.settings.alpha_cap = 0.983;
  check_gradients("below the cap", in);
}

TEST_CASE("reference: an alpha equal to the cap still has its gradient") {
  Inputs<double> in = inputs_of<double>(single(0));
  in.settings.alpha_cap = 0.5;
  CHECK(in.gradients(red_of(in, 2, 2)).opacity_logits[0] == Approx((0.9 - 0.25) * 0.25).epsilon(1e-6));
}

TEST_CASE("reference: the colour's gradient is gated at the pre-clamp sum (B18)") {
  const double y00 = std::sqrt(1 / 3.14159265358979323846) / 2;
  double zero = -0.5 / y00;  // a coefficient whose product with Y is exactly −½
  while (0.5 + y00 * zero > 0) zero = std::nextafter(zero, -10);
  while (0.5 + y00 * zero < 0) zero = std::nextafter(zero, 10);
  for (const double color : {-0.1, 0., 0.1}) {
    Inputs<double> in = inputs_of<double>(single(0));
    in.scene.sh[0] = color == 0 ? zero : (color - 0.5) / y00;
    const reference::Gradients<double> g = in.gradients(red_of(in, 2, 2));
    INFO("colour " << color);
    if (color > 0)
      CHECK(g.sh[0] == Approx(0.5 * y00).epsilon(1e-14));
    else
      CHECK(g.sh[0] == 0);
    CHECK(in.render().color[3 * 12] == Approx(0.5 * std::max(color, 0.) + 0.5 * 0.25).epsilon(1e-14));
  }
}

TEST_CASE("reference: gradients of quaternions are orthogonal to them and shrink with their length (A13)") {
  const SplatScene scene = random_splats(6, 13, kSmall);
  const Inputs<double> in = inputs_of<double>(scene);
  const reference::Gradients<double> g = in.gradients(random_cotangent(in.render(), 3));
  for (const double factor : {1e-6, 1e-3, 1e3, 1e6}) {
    Inputs<double> other = in;
    for (double& x : other.scene.quats) x *= factor;
    const reference::Gradients<double> h = other.gradients(random_cotangent(in.render(), 3));
    for (std::size_t i = 0; i < 6; ++i) {
      double along = 0, size = 0;
      for (std::size_t k = 4 * i; k < 4 * i + 4; ++k) {
        along += h.quats[k] * other.scene.quats[k];
        size += std::abs(h.quats[k] * other.scene.quats[k]);
        CHECK(h.quats[k] * factor == Approx(g.quats[k]).epsilon(1e-9).margin(1e-12));
      }
      CHECK(std::abs(along) <= 1e-12 * size);
    }
  }
}

TEST_CASE("reference: log-scales beyond the limit are held, and have no gradient (A5)") {
  for (const double log_scale : {-200., -20.5, 20.5, 200.}) {
    Inputs<double> in = inputs_of<double>(single(0));
    in.scene.log_scales[0] = log_scale;
    const reference::Gradients<double> g = in.gradients(random_cotangent(in.render(), 3));
    CHECK(g.log_scales[0] == 0);
    CHECK(g.log_scales[1] != 0);
    Inputs<double> held = in;
    held.scene.log_scales[0] = log_scale < 0 ? -20 : 20;
    CHECK(held.render().color == in.render().color);
  }
}

TEST_CASE("reference: the opacity's gradient does not saturate (B15)") {
  for (const double logit : {-80., -20., 0., 15., 17., 20., 40.}) {
    const Inputs<double> in = inputs_of<double>(single(logit));
    const double e = std::exp(-std::abs(logit));
    CHECK(in.gradients(red_of(in, 2, 2)).opacity_logits[0] ==
          Approx((0.9 - 0.25) * e / ((1 + e) * (1 + e))).epsilon(1e-6));
  }
}

TEST_CASE("reference: what contributes nothing has gradients that are exactly 0, and bad numbers stay contained") {
  SplatScene scene = broken_numbers(17, kSmall);
  scene.add({1e30, 0, 0}, 1, 0, {0.5, 0.5, 0.5});
  const Inputs<double> in = inputs_of<double>(scene);
  const reference::Image<double> image = in.render();
  for (const std::vector<double>* x : {&image.color, &image.transmittance, &image.depth_sum}) CHECK(all_finite(*x));
  const reference::Gradients<double> g = in.gradients(random_cotangent(image, 3));
  for (const std::vector<double>* x : {&g.means, &g.quats, &g.log_scales, &g.opacity_logits, &g.sh})
    CHECK(all_finite(*x));
  for (std::size_t i = 0; i < 5; ++i) CHECK(g.opacity_logits[2 * i] == 0);  // NaN in each array
  CHECK(g.opacity_logits[1] != 0);
  const std::size_t zero_quat = static_cast<std::size_t>(scene.count()) - 2;
  CHECK(g.opacity_logits[zero_quat] == 0);
}

TEST_CASE("reference: the factor of antialias has no gradient at its floor (A7)") {
  Inputs<double> in = inputs_of<double>(single(0));
  in.settings.antialias = true;
  in.scene.transforms = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 2};  // flattened onto the view's axis: no area
  const reference::Gradients<double> g = in.gradients(random_cotangent(in.render(), 3));
  CHECK(in.render().transmittance == std::vector<double>(25, 1.));
  for (const std::vector<double>* x : {&g.means, &g.quats, &g.log_scales, &g.opacity_logits, &g.transforms})
    CHECK(all_zero(*x));
  // Without blur there is no covariance to invert: nothing is drawn.
  in.settings.blur = 0;
  CHECK(in.render().transmittance == std::vector<double>(25, 1.));
  CHECK(all_zero(in.gradients(random_cotangent(in.render(), 3)).opacity_logits));
  in.scene.transforms.clear();
  for (const double log_scale : {-9., -5., 0., 2.3}) {
    Inputs<Real> other = inputs_of<Real>(single(0));
    other.settings.antialias = true;
    other.scene.log_scales = {log_scale, log_scale, log_scale};
    check_gradients("antialias", other, 1e-8L);
  }
}

}  // namespace reference_gradients_test
