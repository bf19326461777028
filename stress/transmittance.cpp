// Rows B about stacks of Gaussians at one pixel. Their centres are the pixel's, so that alpha there is the opacity.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/parallel.h"
#include "core/stopwatch.h"
#include "splat/reference/debug_pixel.h"
#include "stress/flat_splats.h"
#include "stress/measures.h"
#include "stress/rows.h"

namespace hsi4d::stress {

namespace {

constexpr double kSumOf60 = 60 * 1.19e-7;  // rounding of as many terms up to 1

SplatView one_pixel(const RenderSettings& settings) { return front_view(1, 1, settings); }

void add_layer(FlatSplats& stack, double alpha, double color) {
  stack.add(0.5, 0.5, 1 + static_cast<double>(stack.count()), 3, alpha, {color});
}

/// T in front of every layer, and the gradients of the pixel by the alphas.
struct StackGradient {
  std::vector<double> in_front, d_alpha;
};

/// In double, without a division: d = T (c − S), S what is seen behind.
StackGradient exact_gradient(const FlatSplats& stack, double stop) {
  StackGradient result;
  std::size_t layers = 0;
  for (double t = 1; layers < stack.opacities.size() && !(t < stop); t *= 1 - stack.opacities[layers++]) {
    result.in_front.push_back(t);
  }
  result.d_alpha.assign(stack.opacities.size(), 0);
  double behind = 0;
  for (std::size_t i = layers; i-- > 0;) {
    result.d_alpha[i] = result.in_front[i] * (stack.features[i] - behind);
    behind = stack.opacities[i] * stack.features[i] + (1 - stack.opacities[i]) * behind;
  }
  return result;
}

/// By the program, in float. A feature's gradient is its weight in the backward pass, T alpha.
StackGradient program_gradient(const FlatSplats& stack, double stop) {
  RenderSettings settings = uncut_settings();
  settings.transmittance_stop = stop;
  FlatRender<float> render(stack, one_pixel(settings));
  render.backward();
  StackGradient result{{}, render.d(render.opacities)};
  const std::vector<double> weights = render.d(render.features);
  for (std::size_t i = 0; i < weights.size() && weights[i] != 0; ++i) {
    result.in_front.push_back(weights[i] / stack.opacities[i]);
  }
  return result;
}

enum class Stored { kTransmittance, kOpacity };

/// In float, from what is stored of the pixel back to its first layer by division by 1 − alpha.
StackGradient divided_gradient(const FlatSplats& stack, double stop, Stored stored) {
  float t = 1, opacity = 0;
  std::size_t layers = 0;
  while (layers < stack.opacities.size() && !(t < static_cast<float>(stop))) {
    const auto alpha = static_cast<float>(stack.opacities[layers++]);
    opacity += t * alpha;
    t *= 1 - alpha;
  }
  if (stored == Stored::kOpacity) t = 1 - opacity;
  StackGradient result;
  result.in_front.resize(layers);
  result.d_alpha.assign(stack.opacities.size(), 0);
  float behind = 0;  // Σ T alpha c of the layers behind
  for (std::size_t i = layers; i-- > 0;) {
    const auto alpha = static_cast<float>(stack.opacities[i]), color = static_cast<float>(stack.features[i]);
    const float inverse = 1 / (1 - alpha);
    t *= inverse;
    result.in_front[i] = static_cast<double>(t);
    result.d_alpha[i] = static_cast<double>(t * color - behind * inverse);
    behind += t * alpha * color;
  }
  return result;
}

/// max |a/b − 1|; infinite if there are not as many.
double largest_relative(const std::vector<double>& a, const std::vector<double>& b) {
  if (a.size() != b.size()) return std::numeric_limits<double>::infinity();
  std::vector<double> ratio, one(a.size(), 1.0);
  for (std::size_t i = 0; i < a.size(); ++i) ratio.push_back(a[i] / b[i]);
  return largest_difference(ratio, one);
}

}  // namespace

/// Stacks that let 1e-2 to 1e-8 through.
std::vector<StressFigure> kept_transmittance(Remedy remedy) {
  double transmittance = 0, early = 0, late = 0;
  RandomSequence random(3, 1);
  for (const double end : {1e-2, 1e-4, 1e-6, 1e-8}) {
    constexpr int kLayers = 37;  // so that no threshold is met exactly
    FlatSplats stack;
    for (int i = 0; i < kLayers; ++i) add_layer(stack, 1 - std::pow(end, 1.0 / kLayers), random.uniform(0, 1));
    for (const double stop : {1e-4, 1e-7}) {
      const StackGradient exact = exact_gradient(stack, stop);
      const StackGradient computed =
          remedy == Remedy::kOn ? program_gradient(stack, stop) : divided_gradient(stack, stop, Stored::kOpacity);
      transmittance = larger(transmittance, largest_relative(computed.in_front, exact.in_front));
      double& gradient = stop == 1e-4 ? early : late;
      gradient = larger(gradient, relative_l2(computed.d_alpha, exact.d_alpha));
    }
  }
  return {{"relative error of T in the backward pass", transmittance, 1e-5},
          {"relative L2 error of d alpha, stop at 1e-4", early, 1e-4},
          {"relative L2 error of d alpha, stop at 1e-7", late, 1e-4}};
}

/// Stacks of which every third layer is as good as opaque, without a cap. Errors are those of the largest gradient of a
/// stack: behind an opaque layer they are differences of nothing.
std::vector<StressFigure> opaque_gradients(Remedy remedy) {
  double broken = 0, error = 0;
  for (const double opacity : {0.999, 1 - 1e-7, 1 / (1 + std::exp(-20.)), 1 / (1 + std::exp(-40.)), 1.0}) {
    FlatSplats stack;
    RandomSequence random(4, 1);
    for (int i = 0; i < 12; ++i) add_layer(stack, i % 3 == 1 ? opacity : 0.5, random.uniform(0, 1));
    const std::vector<double> exact = exact_gradient(stack, 0).d_alpha;
    const std::vector<double> computed = remedy == Remedy::kOn
                                             ? program_gradient(stack, 0).d_alpha
                                             : divided_gradient(stack, 0, Stored::kTransmittance).d_alpha;
    broken += not_finite(computed);
    error = larger(error, largest_difference(computed, exact) / largest_size(exact));
  }
  return {{"gradients that are not finite", broken, 0}, {"error of d alpha, of the largest", error, 1e-5}};
}

std::vector<StressFigure> stop_rule(Remedy remedy) {
  RenderSettings settings;
  settings.alpha_cap = 0.9999;
  if (remedy == Remedy::kOff) settings.stop_rule = StopRule::kExclusive;
  FlatSplats pair;
  add_layer(pair, 1 - 0.0999, 0);
  add_layer(pair, 0.9995, 1);
  const double expected = 0.0999 * 0.9995;
  const double error = std::abs(FlatRender<float>(pair, one_pixel(settings)).image()[0] - expected);
  double worst = 0;  // colours are at most 1
  RandomSequence random(5, 1);
  for (int i = 0; i < 50; ++i) {
    FlatSplats stack;
    for (int k = 0; k < 60; ++k) add_layer(stack, random.uniform(0, 1), random.uniform(0, 1));
    RenderSettings endless = settings;
    endless.transmittance_stop = 0;
    worst = larger(worst, largest_difference(FlatRender<float>(stack, one_pixel(settings)).image(),
                                             FlatRender<float>(stack, one_pixel(endless)).image()));
  }
  return {{"light lost: T = 0.0999, then an opaque one", error, 1.1e-4},
          {"light lost in random stacks", worst, kTransmittanceStop + kSumOf60}};
}

/// A thousand layers just below 1/255, which together are nearly opaque.
std::vector<StressFigure> faint_layers(Remedy remedy) {
  FlatSplats stack;
  for (int i = 0; i < 1000; ++i) stack.add(0.5, 0.5, 1 + i, 3, 0.0039, {1, 1, 1});
  const double exact = 1 - std::pow(1 - stack.opacities[0], 1000);
  const SplatView cut = one_pixel(RenderSettings()), whole = one_pixel(uncut_settings());
  const FlatRender<float> standard(stack, cut), uncut(stack, whole);
  const double lost = exact - standard.image()[0];
  // What is told of that loss: by all alphas that the default skips or, as if each stood alone, by the largest.
  const PixelTrace trace = trace_pixel(uncut.tape, uncut.projected, uncut.opacities, uncut.features, whole, {});
  double through = 1, largest = 0;
  for (const PixelSplat& layer : trace.composited) {
    if (layer.alpha >= cut.settings.alpha_min) continue;
    through *= 1 - layer.alpha;
    largest = larger(largest, layer.alpha);
  }
  const bool on = remedy == Remedy::kOn;
  return {{"opacity lost of 1000 layers of 0.0039", on ? std::abs(uncut.image()[0] - exact) : lost, 1e-5},
          {"opacity lost by default, off what is told", std::abs(lost - (on ? 1 - through : largest)), 1e-5}};
}

/// The catalogue's second is of the program as it is; sanitizers take several times as long.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr double kMostSeconds = 20;
#else
constexpr double kMostSeconds = 1;
#endif

std::vector<StressFigure> million_on_one_pixel(Remedy remedy) {
  RenderSettings settings;
  if (remedy == Remedy::kOff) settings.transmittance_stop = 0;
  const int count = remedy == Remedy::kOn ? 1'000'000 : 100'000;  // without it a tenth is bad enough
  FlatSplats stack;
  const std::vector<double> round = {0.2, 0, 0, 0, 0.2, 0}, front = {1, 1, 1}, back = {0, 1, 1};
  for (int i = 0; i < count; ++i) stack.add(8.5, 8.5, 2, round, 0.3, i < 8 ? front : back);
  const SplatView view = front_view(17, 17, settings);
  FlatRender<float> render(stack, view);
  const std::vector<float> ones(static_cast<std::size_t>(render.out.channels.shape().count()), 1);
  double seconds = 0;
  with_threads(1, [&] {
    Stopwatch watch;
    render.tape.write(render.means);  // as if they had moved
    render.tape.forward(render.out.channels);
    render.tape.backward(render.out.channels, ones);
    seconds = watch.lap();
  });
  const std::vector<double> image = render.image(), t = render.value(render.out.transmittance);
  double outside = 0, sum = 0;
  for (std::size_t p = 0; p < t.size(); ++p) {
    outside = larger(outside, larger(t[p] - 1, -t[p]));
    sum = larger(sum, std::abs(image[t.size() + p] + t[p] - 1));
  }
  const PixelTrace trace = trace_pixel(render.tape, render.projected, render.opacities, render.features, view, {8, 8});
  double rises = trace.composited.empty() ? 1 : 0;
  for (std::size_t i = 1; i < trace.composited.size(); ++i)
    rises += trace.composited[i].transmittance < trace.composited[i - 1].transmittance ? 0 : 1;
  double broken = 0;
  for (const Var<float> var : {render.means, render.factors, render.opacities, render.features})
    broken += not_finite(render.d(var));
  const double order = std::abs(image[8 * 17 + 8] - (1 - std::pow(0.7, 8)));
  // log(stop)/log(1 − alpha_min) layers finish any pixel that one of them is drawn in; 5 × 5 pixels are.
  return {{"(pixel, Gaussian) composited", static_cast<double>(render.out.counters->fragments), 25 * 2360},
          {"(tile, Gaussian) with an adjoint", static_cast<double>(render.out.counters->reached), 20'000},
          {"seconds of a processor, forward and backward", seconds, kMostSeconds},
          {"T outside of [0, 1]", outside, 0},
          {"places at which T does not fall", rises, 0},
          {"sum of weights and T, off 1", sum, 1e-6},
          {"colour off that of the eight in front", order, 1e-6},
          {"gradients that are not finite", broken, 0}};
}

std::vector<StressFigure> opaque_wall(Remedy remedy) {
  FlatSplats stack;
  add_layer(stack, 1, 0);
  add_layer(stack, 1, 1);
  const auto leak = [&](Quality quality) {
    RenderSettings settings;
    apply_quality(settings, quality);
    if (remedy == Remedy::kOff) settings.alpha_cap = kAlphaCapCompatible;
    settings.transmittance_stop = 0;
    const auto cap = static_cast<double>(static_cast<float>(settings.alpha_cap));
    const double image = FlatRender<float>(stack, one_pixel(settings)).image()[0];
    return std::array{image, std::abs(image - (1 - cap) * cap)};
  };
  const auto standard = leak(Quality::kDefault), accurate = leak(Quality::kAccurate);
  return {{"leak through an opaque wall, steps of 1/255", 255 * standard[0], 1.0 / 16},
          {"leak with quality accurate, steps of 1/255", 255 * accurate[0], 0},
          {"leak off (1 - cap) cap", larger(standard[1], accurate[1]), 1e-9}};
}

}  // namespace hsi4d::stress
