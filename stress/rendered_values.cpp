// Rows B about what is composited: depth, opacity, colour, and the exponential.
#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "autodiff/elementwise.h"
#include "core/vector_exp.h"
#include "splat/files/io_splat.h"
#include "splat/limits.h"
#include "splat/reference/reference.h"
#include "splat/render/covariance.h"
#include "splat/render/opacity.h"
#include "splat/render/render.h"
#include "splat/render/sh.h"
#include "stress/flat_splats.h"
#include "stress/measures.h"
#include "stress/pixel_powers.h"
#include "stress/rows.h"
#include "stress/vector_targets.h"

namespace hsi4d::stress {

// --- B14 -------------------------------------------------------------------------------------------------------------

namespace {

/// The depth of a pixel of two Gaussians, in front of each other and of the same opacity, and its gradient.
struct PixelDepth {
  double depth;
  std::vector<double> d_opacities, others;
};

constexpr double kDepths[2] = {2.5, 2.75};

template <class S>
PixelDepth program_depth(double opacity) {
  Tape<S> tape;
  const Var<S> means = leaf(tape, "means", shape_of(2, 3), {0, 0, kDepths[0], 0, 0, kDepths[1]});
  const Var<S> axes = leaf(tape, "axes", shape_of(2, 9), {1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 0, 0, 0, 1, 0, 0, 0, 1});
  const Var<S> opacities = leaf(tape, "opacities", shape_of(2, 1), {opacity, opacity});
  const Var<S> colors = tape.constant("colors", shape_of(2, 3)), background = tape.constant("b", shape_of(1, 3));
  const SplatInputs<S> inputs = {means, axes, opacities, colors};
  const Var<S> depth = render(inputs, tape.constant("xi", shape_of(1, 6)), background,
                              front_view(1, 1, uncut_settings()), {.depth = true, .groups = {}})
                           .depth;
  tape.forward(depth);
  tape.backward(depth, std::vector<S>{1});
  PixelDepth result{numbers_of<S>(tape.value(depth))[0], numbers_of<S>(tape.gradient(opacities)), {}};
  for (const Var<S> var : {means, axes}) {
    const std::vector<double> d = numbers_of<S>(tape.gradient(var));
    result.others.insert(result.others.end(), d.begin(), d.end());
  }
  return result;
}

/// D/A and its gradient wherever A is.
template <class S>
PixelDepth divided_depth(double opacity) {
  const S o = static_cast<S>(opacity), near = S(kDepths[0]), far = S(kDepths[1]);
  const S sum = o * near + (1 - o) * o * far, weight = o + (1 - o) * o, depth = sum / weight;
  const S d_sum = 1 / weight, d_weight = -depth / weight;
  const S in_front = d_sum * near + d_weight, behind = d_sum * far + d_weight;
  return {static_cast<double>(depth),
          {static_cast<double>(in_front - o * behind), static_cast<double>((1 - o) * behind)},
          {static_cast<double>(d_sum * o), static_cast<double>(d_sum * (1 - o) * o)}};
}

}  // namespace

std::vector<StressFigure> normalized_depth(Remedy remedy) {
  const bool on = remedy == Remedy::kOn;
  double broken = 0, depth_error = 0, gradient_error = 0, phantom = 0;
  for (const double opacity : {0.0, 1e-30, 1e-9, 1e-8, 1e-4, 0.5, 1.0}) {
    const PixelDepth computed = on ? program_depth<float>(opacity) : divided_depth<float>(opacity);
    const PixelDepth precise = on ? program_depth<double>(opacity) : divided_depth<double>(opacity);
    broken += not_finite(std::vector<double>{computed.depth}) + not_finite(computed.d_opacities) +
              not_finite(computed.others);
    const double weight = opacity * (2 - opacity);
    if (!(weight > 0)) continue;
    const double expected = (opacity * kDepths[0] + (1 - opacity) * opacity * kDepths[1]) / weight;
    depth_error = larger(depth_error, std::abs(computed.depth / expected - 1));
    if (weight <= kLeastDepthWeight) {
      phantom = larger(phantom, largest_size(computed.d_opacities));
      continue;
    }
    const double d_second = (1 - opacity) * (kDepths[1] - expected) / weight;
    const double d_first = (kDepths[0] - expected - opacity * (kDepths[1] - expected)) / weight;
    gradient_error = larger(gradient_error, largest_difference(precise.d_opacities, {d_first, d_second}) * weight);
  }
  return {{"depths and gradients that are not finite", broken, 0},
          {"relative error of the depth", depth_error, 1e-5},
          {"error of d opacity in double, times weight, m", gradient_error, 1e-6},
          {"d opacity where the weight is below 1e-8", phantom, 0}};
}

// --- B15 -------------------------------------------------------------------------------------------------------------

std::vector<StressFigure> saturated_sigmoid(Remedy remedy) {
  constexpr double kInf = std::numeric_limits<double>::infinity();
  const std::vector<double> logits = {-kInf, -110, -80, -20, 0, 15, 17, 20, 40, 80, kInf};
  std::vector<double> opacities, slopes;
  if (remedy == Remedy::kOn) {
    Tape<float> tape;
    const Var<float> x = leaf(tape, "logits", shape_of(std::ssize(logits), 1), logits), o = gaussian_opacities(x);
    tape.forward(o);
    tape.backward(o, std::vector<float>(logits.size(), 1));
    opacities = numbers_of<float>(tape.value(o));
    slopes = numbers_of<float>(tape.gradient(x));
  } else {
    for (const double logit : logits) {
      const float o = 1 / (1 + std::exp(-static_cast<float>(logit)));
      opacities.push_back(static_cast<double>(o));
      slopes.push_back(static_cast<double>(o * (1 - o)));
    }
  }
  double outside = 0, error = 0;
  for (std::size_t i = 0; i < logits.size(); ++i) {
    outside += opacities[i] >= 0 && opacities[i] <= 1 ? 0 : 1;
    if (std::abs(logits[i]) > 80) continue;
    const double e = std::exp(-std::abs(logits[i])), exact = e / ((1 + e) * (1 + e));
    error = larger(error, std::abs(slopes[i] / exact - 1));
  }
  // Opacities of exactly 0 and 1, as files have them.
  Gaussians ends;
  ends.means.assign(6, 0);
  ends.quats = {1, 0, 0, 0, 1, 0, 0, 0};
  ends.log_scales.assign(6, 0);
  ends.opacity_logits = {-static_cast<float>(kInf), static_cast<float>(kInf)};
  ends.sh.assign(6, 0);
  const std::vector<float> read = decode_splat(encode_splat(ends).bytes, "ends.splat").gaussians.opacity_logits;
  std::vector<double> from_file(read.begin(), read.end());
  if (remedy == Remedy::kOff) {
    from_file.clear();
    for (const double o : {0.0, 1.0}) from_file.push_back(std::log(o) - std::log(1 - o));
  }
  return {{"relative error of the slope, |x| up to 80", error, 1e-6},
          {"opacities outside of [0, 1]", outside, 0},
          {"logits of opacities 0 and 1 that are not finite", not_finite(from_file), 0}};
}

// --- B17 -------------------------------------------------------------------------------------------------------------

namespace {

/// eˣ by putting x into a float's exponent [Schraudolph 1999].
float exponent_exp(float x) {
  const float bits = 12102203.0f * x + 1064866805.0f;
  return std::bit_cast<float>(bits > 0 ? static_cast<std::int32_t>(bits) : 0);
}

/// The worst of an exponential, over neighbours in distance.
struct Banding {
  double ulps = 0, relative = 0, rises = 0;
  double band = 0;  ///< how far a step to a neighbour is from what it has to be

  void add(const Banding& other) {
    ulps = larger(ulps, other.ulps), relative = larger(relative, other.relative), band = larger(band, other.band);
    rises += other.rises;
  }
};

/// @param function  of a wanted argument from 0 down to `lowest`: the argument that it had, and its value
/// @param exact     of an argument, in double
template <class F, class G>
Banding banding(const F& function, const G& exact, double lowest) {
  Banding worst;
  float last = 2;
  double last_off = 0;
  const int steps = 50'000;
  for (int i = 0; i <= steps; ++i) {
    const Pixel<float> pixel = function(static_cast<float>(lowest * i / steps));
    const double truth = exact(static_cast<double>(pixel.argument));
    const double off = static_cast<double>(pixel.value) - truth;
    const auto near = static_cast<float>(truth);
    worst.ulps = larger(worst.ulps, std::abs(off) / static_cast<double>(std::nextafter(near, 2.0f) - near));
    worst.relative = larger(worst.relative, std::abs(off) / truth);
    worst.rises += pixel.value <= last ? 0 : 1;
    if (i > 0) worst.band = larger(worst.band, std::abs(off - last_off));
    last = pixel.value;
    last_off = off;
  }
  return worst;
}

}  // namespace

/// Of loops, and of rows and blocks of pixels on every set of vector instructions. Below −87 the result is less than
/// float's least normal number: 0.
std::vector<StressFigure> quick_exponential(Remedy remedy) {
  using P = Pixel<float>;
  const bool on = remedy == Remedy::kOn;
  const auto loop = [on](float x) { return P{x, on ? vector_exp(x) : exponent_exp(x)}; };
  const auto row = [on](float x) { return on ? row_exponential(x) : P{x, exponent_exp(x)}; };
  const auto block = [on](float p) { return on ? block_exponential(p) : P{p, exponent_exp(0.6931472f * p)}; };
  const auto exp = [](double x) { return std::exp(x); };
  const auto exp2 = [](double p) { return std::exp2(p); };
  Banding loops = banding(loop, exp, -87), blocks;
  constexpr float kInf = std::numeric_limits<float>::infinity();
  double ends = 0;
  for (const float off : {loop(0).value - 1, loop(-kInf).value, loop(-104).value})
    ends = larger(ends, static_cast<double>(std::abs(off)));
  on_every_vector_target([&](const char*) {
    loops.add(banding(row, exp, -87));
    blocks.add(banding(block, exp2, -19.9));
    for (const float one : {row(0).value, block(0).value}) ends = larger(ends, std::abs(static_cast<double>(one) - 1));
  });
  return {{"error of exp, units in the last place", loops.ulps, 1.5},
          {"relative error of alpha in blocks", blocks.relative, 1.9e-7},
          {"places where it rises as the distance does", loops.rises + blocks.rises, 0},
          {"error of the step to a neighbour, steps of 1/255", 255 * larger(loops.band, blocks.band), 1.5e-4},
          {"off 1 at 0, and off 0 far out", ends, 0},
          {"exponentials of NaN that are numbers", std::isnan(loop(std::nanf("")).value) ? 0.0 : 1.0, 0}};
}

// --- B18 -------------------------------------------------------------------------------------------------------------

std::vector<StressFigure> held_color(Remedy remedy) {
  const std::vector<double> wanted = {-0.1, 0, 0.1, -1e-5, 1e-5, 3};
  std::vector<double> sh, colors, d;
  for (const double c : wanted) sh.push_back((c - 0.5) / kShC0);
  if (remedy == Remedy::kOn) {
    Tape<float> tape;
    const Var<float> of = leaf(tape, "sh", shape_of(2, 3), sh), means = tape.constant("means", shape_of(2, 3));
    const Var<float> result = sh_colors(of, means, tape.constant("xi", shape_of(1, 6)), front_view(4, 4));
    tape.forward(result);
    tape.backward(result, std::vector<float>(6, 1));
    colors = numbers_of<float>(tape.value(result));
    d = numbers_of<float>(tape.gradient(of));
  } else {
    for (const double x : sh) colors.push_back(0.5 + kShC0 * x);
    d.assign(6, kShC0);
  }
  double error = 0, powers = 0;
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    const double exact = colors[i] > 0 ? kShC0 : 0;
    error = larger(error, std::abs(d[i] - exact) / kShC0);
    powers += std::isnan(std::pow(colors[i], 1 / 2.2)) ? 1 : 0;
  }
  return {{"d harmonic off the forward pass's branch, of Y0", error, 1e-6},
          {"colours whose power 1/2.2 is not a number", powers, 0}};
}

// --- B19 -------------------------------------------------------------------------------------------------------------

namespace {

constexpr int kWidth = 40, kHeight = 30;

/// Gaussians of all shapes before a plain camera, whose colours change with the direction.
reference::Scene<double> colorful_scene(Index n) {
  RandomSequence random(8, 1);
  reference::Scene<double> scene;
  const auto put = [](std::vector<double>& to, double x) { to.push_back(static_cast<double>(static_cast<float>(x))); };
  scene.n = n;
  scene.sh_coefficients = 16;
  for (Index i = 0; i < n; ++i) {
    const double z = random.uniform(1.5, 4);
    for (const double half : {0.5, 0.375}) put(scene.means, z * random.uniform(-half, half));
    put(scene.means, z);
    const Vector4<double> q = random.rotation();
    for (int k = 0; k < 4; ++k) put(scene.quats, q[k]);
    for (int k = 0; k < 3; ++k) put(scene.log_scales, std::log(z * random.uniform(0.03, 0.2)));
    put(scene.opacity_logits, random.uniform(-2, 2));
    for (int k = 0; k < 48; ++k) put(scene.sh, k < 3 ? random.uniform(0.5, 1.5) : 0.1 * random.normal());
  }
  return scene;
}

/// By brute force.
std::vector<double> exact_d_means(const reference::Scene<double>& scene, const SplatView& view,
                                  const std::vector<double>& weights) {
  const Camera& c = view.camera;
  const reference::Pinhole<double> camera = {
      c.width, c.height, c.fx, c.fy, c.cx, c.cy, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}};
  const std::size_t pixels = weights.size() / 3;
  reference::Image<double> cotangent;
  for (std::size_t p = 0; p < pixels; ++p) {
    for (std::size_t k = 0; k < 3; ++k) cotangent.color.push_back(weights[k * pixels + p]);
  }
  return reference::gradients(scene, camera, {0, 0, 0}, view.settings, cotangent).means;
}

/// By the program, in float.
/// @param turns  colours follow the direction that the mean is seen in
std::vector<double> program_d_means(const reference::Scene<double>& scene, const SplatView& view,
                                    const std::vector<double>& weights, bool turns) {
  Tape<float> tape;
  const Index n = scene.n;
  const Var<float> means = leaf(tape, "means", shape_of(n, 3), scene.means);
  const Var<float> sh = leaf(tape, "sh", shape_of(n, 48), scene.sh), xi = tape.constant("xi", shape_of(1, 6));
  const Var<float> axes = gaussian_axes(leaf(tape, "quats", shape_of(n, 4), scene.quats),
                                        leaf(tape, "log_scales", shape_of(n, 3), scene.log_scales));
  const Var<float> opacities = gaussian_opacities(leaf(tape, "logits", shape_of(n, 1), scene.opacity_logits));
  const Var<float> colors = sh_colors(sh, turns ? means : stop_gradient(means), xi, view);
  const Var<float> image =
      render<float>({means, axes, opacities, colors}, xi, tape.constant("background", shape_of(1, 3)), view).image;
  tape.forward(image);
  tape.backward(image, std::vector<float>(weights.begin(), weights.end()));
  return numbers_of<float>(tape.gradient(means));
}

/// A colour of degree 1 with its gradients, the Gaussian at the camera's centre. Returns how many are not finite.
double broken_at_centre(Remedy remedy) {
  const std::vector<double> sh(12, 0.02);
  if (remedy == Remedy::kOn) {
    Tape<float> tape;
    const Var<float> of = leaf(tape, "sh", shape_of(1, 12), sh), mean = leaf(tape, "mean", shape_of(1, 3), {0, 0, 0});
    const Var<float> color = sh_colors(of, mean, tape.constant("xi", shape_of(1, 6)), front_view(4, 4));
    tape.forward(color);
    tape.backward(color, std::vector<float>(3, 1));
    return not_finite(numbers_of<float>(tape.value(color))) + not_finite(numbers_of<float>(tape.gradient(of))) +
           not_finite(numbers_of<float>(tape.gradient(mean)));
  }
  const float length = std::sqrt(0.0f), unit = 0 / length;  // of each component
  float basis[4];
  sh_basis(1, unit, unit, unit, basis);
  std::vector<double> numbers(basis, basis + 4);
  return not_finite(numbers);
}

}  // namespace

std::vector<StressFigure> color_direction(Remedy remedy) {
  const SplatView view = front_view(kWidth, kHeight, uncut_settings());
  const reference::Scene<double> scene = colorful_scene(40);
  std::vector<double> weights(3 * kWidth * kHeight);
  RandomSequence random(9, 1);
  for (double& w : weights) w = static_cast<double>(static_cast<float>(random.uniform(-1, 1)));
  const std::vector<double> computed = program_d_means(scene, view, weights, remedy == Remedy::kOn);
  return {{"relative L2 error of d mean", relative_l2(computed, exact_d_means(scene, view, weights)), 1e-4},
          {"numbers not finite, mean at the camera's centre", broken_at_centre(remedy), 0}};
}

}  // namespace hsi4d::stress
