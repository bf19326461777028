// Rows B about gradients: they have to take the branches, and the numbers, of the forward pass.
#include <algorithm>
#include <array>
#include <cmath>

#include "stress/flat_splats.h"
#include "stress/measures.h"
#include "stress/rows.h"
#include "stress/textbook_splat.h"

namespace hsi4d::stress {

// --- B3 --------------------------------------------------------------------------------------------------------------

/// A Gaussian at one pixel, its mean beside the centre, so opaque that a cap of 0.99 holds it, or hardly not.
std::vector<StressFigure> cap_gradient(Remedy remedy) {
  RenderSettings settings;
  settings.alpha_cap = 0.99;
  if (remedy == Remedy::kOff) settings.cap_gradient = CapGradient::kPass;
  const double g = std::exp(-0.5 * (0.2 * 0.2 + 0.1 * 0.1) / (9 + kBlur));
  const auto run = [&](double opacity) {
    FlatSplats splats;
    splats.add(0.7, 0.4, 1, 3, opacity, {1});
    FlatRender<float> render(splats, front_view(1, 1, settings));
    render.backward();
    std::vector<double> shape = render.d(render.means);
    const std::vector<double> factor = render.d(render.factors);
    shape.insert(shape.end(), factor.begin(), factor.end());
    return std::pair(render.d(render.opacities)[0], largest_size(shape));
  };
  const auto [d_held, d_held_shape] = run(0.9999);
  const double free = run(0.99 / g * (1 - 1e-5)).first;
  return {{"d opacity where the cap holds alpha", std::abs(d_held), 0},
          {"d mean and d shape there", d_held_shape, 0},
          {"relative error of d opacity just below the cap", std::abs(free / g - 1), 1e-6}};
}

// --- B6 --------------------------------------------------------------------------------------------------------------

/// Gradients by the means against central differences of fourth order, with what tests use, and with the cuts of runs.
std::vector<StressFigure> differences_across_cuts(Remedy remedy) {
  constexpr int kWidth = 35, kHeight = 20;
  constexpr double kStep = 0.02;  // pixels
  const SplatView view = front_view(kWidth, kHeight, remedy == Remedy::kOn ? uncut_settings() : RenderSettings());
  FlatRender<double> render(random_splats(25, kWidth, kHeight, 1, 9), view);
  std::vector<double> weights(kWidth * kHeight);
  RandomSequence random(2, 1);
  for (double& w : weights) w = random.uniform(-1, 1);
  render.backward(weights);
  const std::vector<double> computed = render.d(render.means), at = render.value(render.means);
  const auto loss = [&](std::size_t i, double step) {
    std::vector<double> moved = at;
    moved[i] += step;
    render.tape.set(render.means, moved);
    render.tape.forward(render.out.channels);
    const std::vector<double> image = render.image();
    double sum = 0;
    for (std::size_t p = 0; p < image.size(); ++p) sum += weights[p] * image[p];
    return sum;
  };
  std::vector<double> differences;
  for (std::size_t i = 0; i < at.size(); ++i) {
    differences.push_back((8 * (loss(i, kStep) - loss(i, -kStep)) - (loss(i, 2 * kStep) - loss(i, -2 * kStep))) /
                          (12 * kStep));
  }
  return {{"d mean off differences, of the largest", largest_difference(computed, differences) / largest_size(computed),
           1e-5}};
}

// --- B13 -------------------------------------------------------------------------------------------------------------

namespace {

/// Needles through the image's only pixel, each behind the one before.
FlatSplats needles_at_pixel(Index n) {
  RandomSequence random(21, 1);
  FlatSplats splats;
  for (Index i = 0; i < n; ++i) {
    const double angle = random.uniform(0, 3.14159), length = random.uniform(3, 100), width = 0.01;
    const double c = std::cos(angle), s = std::sin(angle), along = random.uniform(-1, 1) * length;
    const double aside = random.uniform(-0.5, 0.5);
    splats.add(0.5 + c * along - s * aside, 0.5 + s * along + c * aside, 1 + static_cast<double>(i),
               {c * length, -s * width, 0, s * length, c * width, 0}, random.uniform(0.05, 0.5), {1});
  }
  return splats;
}

/// Weights of all Gaussians in the forward and in the backward pass.
struct Weights {
  std::vector<double> forward, backward;
};

/// By features that name Gaussians, eight at a time: the image's channels are their weights, and so are the features'
/// gradients.
Weights program_weights(const FlatSplats& splats, const SplatView& view) {
  constexpr Index kTogether = 8;
  const Index n = splats.count();
  Weights weights;
  for (Index first = 0; first < n; first += kTogether) {
    FlatSplats names = splats;
    names.channels = kTogether;
    names.features.assign(static_cast<std::size_t>(n * kTogether), 0);
    const Index count = std::min(kTogether, n - first);
    for (Index k = 0; k < count; ++k) names.features[(first + k) * kTogether + k] = 1;
    FlatRender<float> render(names, view);
    render.backward();
    const std::vector<double> image = render.image(), d = render.d(render.features);
    for (Index k = 0; k < count; ++k) {
      weights.forward.push_back(image[k]);
      weights.backward.push_back(d[(first + k) * kTogether + k]);
    }
  }
  return weights;
}

/// Alpha by the inverse of the covariance in float; contracted as a compiler may do it in one of two passes.
float conic_alpha(const FlatSplats& splats, std::size_t n, bool contracted) {
  std::array<float, 6> v;
  std::copy_n(splats.factors.begin() + static_cast<Index>(6 * n), 6, v.begin());
  const TextbookSplat<float> splat = textbook_splat(v, static_cast<float>(kBlur));
  const auto x = static_cast<float>(0.5 - splats.means[2 * n]), y = static_cast<float>(0.5 - splats.means[2 * n + 1]);
  const float s =
      contracted ? std::fma(0.5f, std::fma(splat.a * x, x, splat.c * y * y), splat.b * x * y) : splat.exponent(x, y);
  return std::min(0.99f, static_cast<float>(splats.opacities[n]) * std::exp(-s));
}

/// The backward pass contracted.
Weights contracted_weights(const FlatSplats& splats) {
  Weights weights;
  float t = 1, t_again = 1;
  for (std::size_t i = 0; i < splats.depths.size(); ++i) {
    const float alpha = conic_alpha(splats, i, false), again = conic_alpha(splats, i, true);
    weights.forward.push_back(static_cast<double>(t * alpha));
    weights.backward.push_back(static_cast<double>(t_again * again));
    t *= 1 - alpha;
    t_again *= 1 - again;
  }
  return weights;
}

/// T in front of the first Gaussian as a backward pass gets it that divides the forward pass's T behind all by its own
/// 1 − alpha: the ratio of both passes' T.
double recovered_transmittance(const Weights& weights) {
  double forward = 1, backward = 1;
  for (const double w : weights.forward) forward -= w;
  for (const double w : weights.backward) backward -= w;
  return forward / backward;
}

}  // namespace

std::vector<StressFigure> recomputed_alpha(Remedy remedy) {
  const FlatSplats splats = needles_at_pixel(40);
  const Weights weights =
      remedy == Remedy::kOn ? program_weights(splats, front_view(1, 1, uncut_settings())) : contracted_weights(splats);
  double one_pass = 0;
  for (std::size_t i = 0; i < weights.forward.size(); ++i) {
    one_pass += (weights.forward[i] != 0) != (weights.backward[i] != 0) ? 1 : 0;
  }
  return {{"weights that differ, forward and backward", unequal(weights.backward, weights.forward), 0},
          {"Gaussians that one of the passes has alone", one_pass, 0},
          {"T recovered in front of the first, off 1", std::abs(recovered_transmittance(weights) - 1), 0}};
}

// --- B21 -------------------------------------------------------------------------------------------------------------

namespace {

constexpr int kConicSide = 16;

/// Σ weight · o exp(−½ dᵀ cov⁻¹ d) over an image, in long double. `factor` is 2×3 by rows.
long double image_loss(const std::array<long double, 6>& f, long double opacity, const std::vector<double>& weights) {
  const auto splat = textbook_splat<long double>(f, kBlur);
  long double sum = 0;
  for (int p = 0; p < kConicSide * kConicSide; ++p) {
    const long double x = p % kConicSide + 0.5L - 8, y = p / kConicSide + 0.5L - 8;
    sum += weights[p] * opacity * std::exp(-splat.exponent(x, y));
  }
  return sum;
}

/// Gradient by the factor through the conic's three numbers (a, b, c) of ½ (a x² + c y²) + b x y, with half of that by
/// b taken for an entry of the symmetric matrix, as if it were not yet halved.
std::vector<double> halved_gradient(const FlatSplats& splats, const std::vector<double>& weights) {
  const std::array<double, 6> f = splats.factor(0);
  const auto splat = textbook_splat(f, kBlur);
  const double a = splat.a, b = splat.b, c = splat.c;
  double d_a = 0, d_b = 0, d_c = 0;
  for (int p = 0; p < kConicSide * kConicSide; ++p) {
    const double x = p % kConicSide + 0.5 - 8, y = p / kConicSide + 0.5 - 8;
    const double d_s = -weights[p] * splats.opacities[0] * std::exp(-splat.exponent(x, y));
    d_a += d_s * 0.5 * x * x;
    d_b += d_s * 0.5 * x * y;  // is x y
    d_c += d_s * 0.5 * y * y;
  }
  const double off = 0.5 * d_b;
  // d_cov = −C D C with C = [a b; b c], D = [d_a off; off d_c]; d_V = 2 d_cov V
  const double m00 = a * d_a + b * off, m01 = a * off + b * d_c, m10 = b * d_a + c * off, m11 = b * off + c * d_c;
  const double xx_d = -(m00 * a + m01 * b), xy_d = -(m00 * b + m01 * c), yy_d = -(m10 * b + m11 * c);
  std::vector<double> d(6);
  for (std::size_t k = 0; k < 3; ++k) {
    d[k] = 2 * (xx_d * f[k] + xy_d * f[3 + k]);
    d[3 + k] = 2 * (xy_d * f[k] + yy_d * f[3 + k]);
  }
  return d;
}

}  // namespace

/// Turned Gaussians alone in an image, against differences of the plain formula.
std::vector<StressFigure> conic_gradient(Remedy remedy) {
  RandomSequence random(6, 1);
  std::vector<double> weights(kConicSide * kConicSide);
  for (double& w : weights) w = random.uniform(-1, 1);
  double worst = 0;
  for (int i = 0; i < 12; ++i) {
    FlatSplats splats;
    std::vector<double> factor(6);
    for (double& x : factor) x = random.uniform(-3, 3);
    splats.add(8, 8, 1, factor, 0.7, {1});
    FlatRender<double> render(splats, front_view(kConicSide, kConicSide, uncut_settings()));
    render.backward(weights);
    const std::vector<double> computed =
        remedy == Remedy::kOn ? render.d(render.factors) : halved_gradient(splats, weights);
    std::vector<double> differences;
    for (std::size_t k = 0; k < 6; ++k) {
      constexpr long double kStep = 1e-6L;
      std::array<long double, 6> up, down;
      std::copy_n(splats.factors.begin(), 6, up.begin());
      down = up;
      up[k] += kStep, down[k] -= kStep;
      const long double opacity = splats.opacities[0];
      differences.push_back(
          static_cast<double>((image_loss(up, opacity, weights) - image_loss(down, opacity, weights)) / (2 * kStep)));
    }
    worst = larger(worst, largest_difference(computed, differences) / largest_size(differences));
  }
  return {{"d V off differences, of the largest", worst, 1e-6}};
}

}  // namespace hsi4d::stress
