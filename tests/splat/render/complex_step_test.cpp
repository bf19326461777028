// Operators of splat against complex steps of formulas that are written down here a second time.
#include <algorithm>
#include <array>
#include <numeric>

#include "core/rigid.h"
#include "splat/render/camera_center.h"
#include "splat/render/composite.h"
#include "splat/render/covariance.h"
#include "splat/render/opacity.h"
#include "splat/render/render.h"
#include "splat/render/sh.h"
#include "tests/support/complex_step_check.h"
#include "tests/support/flat_splats.h"

namespace complex_step_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

using V = Var<double>;
using Vars = std::vector<V>;

SplatView view_from_aside() {
  SplatView view;
  view.camera = {64, 48, 60, 61, 31, 25, look_at({3, -2, 1.5}, {0, 0.3, 1})};
  return view;
}

/// Exp(ξ) T.
Rigid<Complex> moved(const SplatView& view, const Complexes& xi) {
  const Rigid<double>& t = view.camera.camera_from_world;
  Vector6<Complex> x;
  for (int i = 0; i < 6; ++i) x[i] = xi[static_cast<std::size_t>(i)];
  return compose(se3_exp(x), Rigid<Complex>{t.rotation.cast<Complex>(), t.translation.cast<Complex>()});
}

Vector3<Complex> vector_at(const Complexes& x, std::size_t row) { return {x[3 * row], x[3 * row + 1], x[3 * row + 2]}; }

/// By rows.
Matrix3<Complex> matrix_at(const Complexes& x, std::size_t begin) {
  Matrix3<Complex> m;
  for (int i = 0; i < 9; ++i) m(i / 3, i % 3) = x[begin + static_cast<std::size_t>(i)];
  return m;
}

void append(Complexes& y, const Matrix3<Complex>& m) {
  for (int i = 0; i < 9; ++i) y.push_back(m(i / 3, i % 3));
}

/// R of q/|q| and times the scales.
Complexes plain_axes(const ComplexInputs& in) {
  Complexes y;
  for (std::size_t n = 0; n < in[0].size() / 4; ++n) {
    const Complex* const q = &in[0][4 * n];
    const Complex length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    const Complex w = q[0] / length, a = q[1] / length, b = q[2] / length, c = q[3] / length;
    Matrix3<Complex> r;
    r << w * w + a * a - b * b - c * c, 2.0 * (a * b - w * c), 2.0 * (a * c + w * b), 2.0 * (a * b + w * c),
        w * w - a * a + b * b - c * c, 2.0 * (b * c - w * a), 2.0 * (a * c - w * b), 2.0 * (b * c + w * a),
        w * w - a * a - b * b + c * c;
    for (int k = 0; k < 3; ++k) r.col(k) *= std::exp(in[1][3 * n + static_cast<std::size_t>(k)]);
    append(y, r);
  }
  return y;
}

/// What `project` makes of means, axes and ξ: numbers in the image, factors, depths.
std::array<Complexes, 3> plain_projection(const SplatView& view, const ComplexInputs& in) {
  const Rigid<Complex> camera = moved(view, in[2]);
  std::array<Complexes, 3> out;
  for (std::size_t n = 0; n < in[0].size() / 3; ++n) {
    const Vector3<Complex> p = transform_point(camera, vector_at(in[0], n));
    const Matrix3<Complex> axes = camera.rotation * matrix_at(in[1], 9 * n);
    const double focal[2] = {view.camera.fx, view.camera.fy}, center[2] = {view.camera.cx, view.camera.cy};
    for (int i = 0; i < 2; ++i) {
      out[0].push_back(focal[i] * p[i] / p[2] + center[i]);
      for (int k = 0; k < 3; ++k) out[1].push_back(focal[i] / p[2] * (axes(i, k) - p[i] / p[2] * axes(2, k)));
    }
    out[2].push_back(p[2]);
  }
  return out;
}

/// max(0, ½ + Σ Y sh) of 16 coefficients, as a moved object has them.
Complexes plain_colors(const SplatView& view, const ComplexInputs& in) {
  const Rigid<Complex> camera = moved(view, in[2]);
  const Vector3<Complex> center = -(camera.rotation.transpose() * camera.translation);
  Matrix3<Complex> linear;
  for (int i = 0; i < 9; ++i) linear(i / 3, i % 3) = in[3][static_cast<std::size_t>(4 * (i / 3) + i % 3)];
  Complexes y;
  for (std::size_t n = 0; n < in[1].size() / 3; ++n) {
    const Vector3<Complex> away = vector_at(in[1], n) - center;
    const Vector3<Complex> r = linear.transpose() * (away / std::sqrt(dot(away, away)));
    Complex basis[16];
    sh_basis(3, r[0], r[1], r[2], basis);
    for (std::size_t c = 0; c < 3; ++c) {
      Complex sum = 0.5;
      for (std::size_t k = 0; k < 16; ++k) sum += basis[k] * in[0][48 * n + 3 * k + c];
      y.push_back(complex_max(sum, 0));
    }
  }
  return y;
}

/// Σ T α f + T background of every pixel, Gaussians in the order of `depths`; inputs means, factors, opacities,
/// features, background.
Complexes plain_composite(const ComplexInputs& in, const std::vector<double>& depths, int width, int height,
                          double blur) {
  std::vector<std::size_t> order(depths.size());
  std::iota(order.begin(), order.end(), std::size_t(0));
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return depths[a] < depths[b]; });
  const auto pixels = static_cast<std::size_t>(width * height);
  Complexes image(3 * pixels);
  for (std::size_t at = 0; at < pixels; ++at) {
    const double x = static_cast<double>(at % static_cast<std::size_t>(width)) + 0.5;
    const double y = static_cast<double>(at / static_cast<std::size_t>(width)) + 0.5;
    Complex t = 1, color[3] = {};
    for (const std::size_t n : order) {
      const Complex* const v = &in[1][6 * n];
      const Complex a = v[0] * v[0] + v[1] * v[1] + v[2] * v[2] + blur, b = v[0] * v[3] + v[1] * v[4] + v[2] * v[5];
      const Complex c = v[3] * v[3] + v[4] * v[4] + v[5] * v[5] + blur;
      const Complex dx = x - in[0][2 * n], dy = y - in[0][2 * n + 1];
      const Complex square = (c * dx * dx - 2.0 * b * dx * dy + a * dy * dy) / (a * c - b * b);
      const Complex alpha = in[2][n] * std::exp(-0.5 * square);
      for (std::size_t k = 0; k < 3; ++k) color[k] += t * alpha * in[3][3 * n + k];
      t *= 1.0 - alpha;
    }
    for (std::size_t k = 0; k < 3; ++k) image[k * pixels + at] = color[k] + t * in[4][k];
  }
  return image;
}

}  // namespace

TEST_CASE("axes and opacities of Gaussians have the gradients of complex steps") {
  check_complex_step(
      {{"quats", shape_of(6, 4)}, {"log_scales", shape_of(6, 3), -3, 2}},
      [](const Vars& in) { return gaussian_axes(in[0], in[1]); }, plain_axes);
  check_complex_step(
      {{"transforms", shape_of(6, 12)}, {"axes", shape_of(6, 9)}},
      [](const Vars& in) { return transform_axes(in[0], in[1]); },
      [](const ComplexInputs& in) {
        Complexes y;
        for (std::size_t n = 0; n < 6; ++n) {
          Matrix3<Complex> linear;
          for (int i = 0; i < 9; ++i)
            linear(i / 3, i % 3) = in[0][12 * n + static_cast<std::size_t>(4 * (i / 3) + i % 3)];
          append(y, linear * matrix_at(in[1], 9 * n));
        }
        return y;
      });
  check_complex_step(
      {{"logits", shape_of(20, 1), -20, 20}}, [](const Vars& in) { return gaussian_opacities(in[0]); },
      [](const ComplexInputs& in) {
        Complexes y;
        for (const Complex x : in[0]) y.push_back(1.0 / (1.0 + std::exp(-x)));
        return y;
      });
}

TEST_CASE("projection and the camera's centre have the gradients of complex steps") {
  const SplatView view = view_from_aside();
  const OperatorInput xi{"xi", shape_of(1, 6), -0.1, 0.1};
  check_complex_step(
      {xi}, [&](const Vars& in) { return camera_center(in[0], view); },
      [&](const ComplexInputs& in) {
        const Rigid<Complex> camera = moved(view, in[0]);
        const Vector3<Complex> c = -(camera.rotation.transpose() * camera.translation);
        return Complexes{c[0], c[1], c[2]};
      });
  const std::vector<OperatorInput> inputs = {
      {"means", shape_of(7, 3), -0.3, 0.3}, {"axes", shape_of(7, 9), -0.2, 0.2}, xi};
  for (const std::size_t output : {0, 1, 2}) {
    check_complex_step(
        inputs,
        [&](const Vars& in) {
          const Projected<double> p = project(in[0], in[1], in[2], view);
          return std::array{p.means_px, p.factors, p.depths}[output];
        },
        [&](const ComplexInputs& in) { return plain_projection(view, in)[output]; });
  }
}

TEST_CASE("colours have the gradients of complex steps") {
  const SplatView view = view_from_aside();
  check_complex_step(
      {{"sh", shape_of(9, 48), -0.3, 0.3},
       {"means", shape_of(9, 3)},
       {"xi", shape_of(1, 6), -0.2, 0.2},
       {"transform", shape_of(1, 12)}},
      [&](const Vars& in) { return sh_colors(in[0], in[1], in[2], view, in[3]); },
      [&](const ComplexInputs& in) { return plain_colors(view, in); });
}

TEST_CASE("compositing has the gradients of complex steps") {
  constexpr int kWidth = 11, kHeight = 7;
  const FlatSplats splats = random_flat(8, kWidth, kHeight, 3, 5);
  const SplatView view = front_view(kWidth, kHeight, uncut_settings());
  check_complex_step(
      {{"means", shape_of(8, 2), 0, 0, splats.means},
       {"factors", shape_of(8, 6), 0, 0, splats.factors},
       {"opacities", shape_of(8, 1), 0, 0, splats.opacities},
       {"features", shape_of(8, 3), 0, 0, splats.features},
       {"background", shape_of(1, 3), 0, 1}},
      [&](const Vars& in) {
        Tape<double>& tape = in[0].owner();
        const V depths = tape.constant("depths", shape_of(8, 1));
        tape.set(depths, splats.depths);
        const Projected<double> projected{in[0], in[1], depths, tape.constant("rest", shape_of(8, 1)),
                                          tape.constant("rest", shape_of(8, 2))};
        return composite(SplatSet<double>{projected, in[2], in[3]}, view, in[4]).channels;
      },
      [&](const ComplexInputs& in) { return plain_composite(in, splats.depths, kWidth, kHeight, view.settings.blur); });
}

TEST_CASE("depth has the gradients of complex steps") {
  SplatView view = view_from_aside();
  view.settings = uncut_settings();
  view.settings.blur = 300;  // wide enough that the depth has a gradient in every pixel
  RenderRequest request;
  request.depth = true;
  constexpr Index kCount = 5;
  check_complex_step(
      {{"means", shape_of(kCount, 3), -0.3, 0.3},
       {"axes", shape_of(kCount, 9), -0.2, 0.2},
       {"xi", shape_of(1, 6), -0.1, 0.1},
       {"opacities", shape_of(kCount, 1), 0.2, 0.9}},
      [&](const Vars& in) {
        Tape<double>& tape = in[0].owner();
        const V colors = tape.constant("colors", shape_of(kCount, 3)), black = tape.constant("black", shape_of(1, 3));
        return render<double>({in[0], in[1], in[3], colors}, in[2], black, view, request).depth;
      },
      [&](const ComplexInputs& in) {
        const std::array<Complexes, 3> projected = plain_projection(view, in);
        Complexes features;
        std::vector<double> depths;
        for (const Complex z : projected[2]) {
          features.insert(features.end(), {z, 1, 0});
          depths.push_back(z.real());
        }
        const Camera& camera = view.camera;
        const Complexes sums = plain_composite({projected[0], projected[1], in[3], features, Complexes(3)}, depths,
                                               camera.width, camera.height, view.settings.blur);
        const std::size_t pixels = sums.size() / 3;
        Complexes depth(pixels);
        for (std::size_t i = 0; i < pixels; ++i) depth[i] = sums[i] / sums[pixels + i];
        return depth;
      });
}

}  // namespace complex_step_test
