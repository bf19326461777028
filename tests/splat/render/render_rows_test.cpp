// Rows of docs/numerics/failures.md that take fits, or a large image.
#include <algorithm>
#include <cmath>
#include <cstdio>

#include <catch2/catch.hpp>

#include "core/parallel.h"
#include "tests/support/flat_splats.h"

namespace render_rows_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

std::vector<double> image_of(const SplatScene& scene) {
  TapedSplats<double> taped(scene, cotangent_of(scene.camera));
  taped.tape.forward(taped.rendered.image);
  return taped.value(taped.rendered.image);
}

double mean_square(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return sum / static_cast<double>(a.size());
}

double decibels(double mean_square) { return -10 * std::log10(mean_square); }

/// What a sensor sees: the scene without a blur at `times` the size, averaged over pixels.
std::vector<double> seen(SplatScene scene, int times) {
  const int width = scene.camera.width, height = scene.camera.height;
  scene.camera.width *= times, scene.camera.height *= times;
  for (double* x : {&scene.camera.fx, &scene.camera.fy, &scene.camera.cx, &scene.camera.cy}) *x *= times;
  scene.settings.blur = 1e-6;
  const std::vector<double> fine = image_of(scene);
  std::vector<double> image(static_cast<std::size_t>(3 * width * height));
  for (std::size_t i = 0; i < fine.size(); ++i) {
    const auto w = static_cast<std::size_t>(width), h = static_cast<std::size_t>(height);
    const auto n = static_cast<std::size_t>(times), x = i % (w * n), y = i / (w * n) % (h * n), k = i / (w * n * h * n);
    image[(k * h + y / n) * w + x / n] += fine[i] / (times * times);
  }
  return image;
}

/// Sizes and opacities fitted to an image by Adam; the error of the fit.
double fit(SplatScene& scene, const std::vector<double>& target, int steps) {
  struct Moments {
    std::vector<double> m, v;
  } moments[2];
  SplatCotangent cotangent = cotangent_of(scene.camera);
  cotangent.transmittance.clear();
  TapedSplats<float> taped(scene, cotangent);
  const Var<float> leaves[] = {taped.log_scales, taped.opacity_logits};
  double error = 0;
  for (int step = 1; step <= steps; ++step) {
    taped.tape.forward(taped.rendered.image);
    const std::vector<double> image = taped.value(taped.rendered.image);
    error = mean_square(image, target);
    std::vector<float> d(image.size());
    for (std::size_t i = 0; i < d.size(); ++i) d[i] = static_cast<float>(image[i] - target[i]);
    taped.tape.backward(taped.rendered.image, d);
    for (std::size_t l = 0; l < 2; ++l) {
      const std::vector<double> g = taped.gradient(leaves[l]);
      std::vector<double> x = taped.value(leaves[l]);
      moments[l].m.resize(g.size()), moments[l].v.resize(g.size());
      for (std::size_t i = 0; i < g.size(); ++i) {
        double &m = moments[l].m[i], &v = moments[l].v[i];
        m = 0.9 * m + 0.1 * g[i], v = 0.99 * v + 0.01 * g[i] * g[i];
        x[i] -= 0.03 * m / (1 - std::pow(0.9, step)) / (std::sqrt(v / (1 - std::pow(0.99, step))) + 1e-12);
      }
      taped.tape.set(leaves[l], std::vector<float>(x.begin(), x.end()));
    }
  }
  const auto back = [&](std::vector<float>& to, Var<float> from) {
    const std::vector<double> numbers = taped.value(from);
    to.assign(numbers.begin(), numbers.end());
  };
  back(scene.log_scales, taped.log_scales);
  back(scene.opacity_logits, taped.opacity_logits);
  return error;
}

}  // namespace

TEST_CASE("what is fitted at half of the size and drawn at the whole is told by how many decibels [A9]") {
  SplatScene truth = random_splats(150, 35, {96, 72});
  for (float& x : truth.log_scales) x -= 1.5F;  // smaller than pixels, most of them
  SplatScene half = truth;
  half.camera = tilted_camera({48, 36});
  const std::vector<double> small = seen(half, 8), large = seen(truth, 8);
  double drop[2];
  for (const bool antialias : {false, true}) {
    SplatScene fitted = half;
    fitted.settings.antialias = antialias;
    const double at_half = decibels(fit(fitted, small, 150));
    fitted.camera = truth.camera;
    const double at_whole = decibels(mean_square(image_of(fitted), large));
    drop[antialias] = at_half - at_whole;
    std::printf("fitted at half of the size%s: PSNR %.1f dB there, %.1f dB at the whole\n",
                antialias ? " with antialias" : "", at_half, at_whole);
    CHECK(at_half > 25);
  }
  CHECK(drop[true] < drop[false] - 2);
}

TEST_CASE("fifty steps of a fit give the same bits on 1, 2, 3 and 16 threads, each time [F6]", "[parallel]") {
  SplatScene scene = random_splats(1200, 37, {64, 48});
  const auto fitted = [&](int threads) {
    std::vector<double> all;
    with_threads(threads, [&] {
      TapedSplats<float> taped(scene, cotangent_of(scene.camera));
      const Var<float> leaves[] = {taped.means,          taped.quats, taped.log_scales,
                                   taped.opacity_logits, taped.sh,    taped.xi};
      for (int step = 0; step < 50; ++step) {
        taped.run();
        for (const Var<float> leaf : leaves) {
          const std::vector<double> d = taped.gradient(leaf), x = taped.value(leaf);
          std::vector<float> next(x.size());
          for (std::size_t i = 0; i < x.size(); ++i) next[i] = static_cast<float>(x[i] - 1e-4 * d[i]);
          taped.tape.set(leaf, next);
        }
      }
      for (const Var<float> leaf : leaves) {
        const std::vector<double> x = taped.value(leaf);
        all.insert(all.end(), x.begin(), x.end());
      }
    });
    return all;
  };
  const std::vector<double> first = fitted(1);
  CHECK(std::any_of(first.begin(), first.end(), [](double x) { return x != 0; }));
  for (int repeat = 0; repeat < 5; ++repeat) {
    for (const int threads : {1, 2, 3, 16}) {
      const bool has_the_bits = fitted(threads) == first;
      INFO(threads << " threads, repeat " << repeat);
      CHECK(has_the_bits);
    }
  }
}

TEST_CASE("gradients of one Gaussian over millions of pixels [F7]") {
  for (const auto& [width, height] : {std::pair(2048, 2048), std::pair(4096, 256)}) {
    FlatSplats splats;
    splats.add(0.45 * width, 0.55 * height, 1, 0.4 * width, 0.7, {0.8});
    for (std::size_t k = 0; k < 6; ++k) splats.factors[k] += 0.05 * static_cast<double>(width * (k % 3));
    for (double& x : splats.factors) x = static_cast<float>(x);
    for (auto* numbers : {&splats.means, &splats.opacities, &splats.features}) {
      for (double& x : *numbers) x = static_cast<float>(x);
    }
    const SplatView view = front_view(width, height);
    const auto gradients = [&]<class S>(S) {
      FlatRender<S> flat(splats, view);
      std::vector<S> cotangent(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
      for (std::size_t i = 0; i < cotangent.size(); ++i) {
        const auto x = static_cast<float>(i % static_cast<std::size_t>(width)) / static_cast<float>(width);
        cotangent[i] = static_cast<S>(0.25F + x * x);  // no sum cancels
      }
      flat.backward(cotangent);
      return std::array{flat.d(flat.means), flat.d(flat.factors), flat.d(flat.opacities), flat.d(flat.features)};
    };
    const auto computed = gradients(float()), expected = gradients(double());
    for (std::size_t i = 0; i < computed.size(); ++i) {
      INFO(width << " x " << height << ", class " << i << ": " << relative_l2(computed[i], expected[i]));
      CHECK(relative_l2(computed[i], expected[i]) < 1e-6);
    }
  }
}

}  // namespace render_rows_test
