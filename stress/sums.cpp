// Rows F6 to F8: sums that follow the threads, sums over many pixels, and numbers of few bits.
#include <array>
#include <cmath>

#include "autodiff/difference.h"
#include "autodiff/elementwise.h"
#include "autodiff/reduce.h"
#include "stress/measures.h"
#include "stress/plain_adam.h"
#include "stress/rows.h"
#include "stress/splat_scene.h"
#include "stress/tape_numbers.h"
#include "stress/thread_order.h"

namespace hsi4d::stress {

namespace {

/// A scene fitted to the image of another, with an offset of all colours, after fifty steps.
std::vector<double> fitted(int threads, Remedy remedy) {
  std::vector<double> all;
  with_threads(threads, [&] {
    const Scene scene = small_scene(200, 80, 48, 6);
    TapedScene<float> taped(scene);
    const Var<float> offset = taped.tape.parameter("offset", kScalarShape);
    const Var<float> image = taped.rendered.image, target = taped.tape.constant("target", image.shape());
    set_numbers(taped.tape, target, exact_image(small_scene(200, 80, 48, 7)));
    const Var<float> loss = l2(remedy == Remedy::kOn ? image + offset : offset_by_threads(image, offset), target);
    std::vector<Var<float>> leaves = taped.leaves();
    leaves.push_back(offset);
    Adam<float> adam(taped.tape, {moving_at(leaves, 0.01)}, {});
    for (int step = 0; step < 50; ++step) {
      taped.tape.forward(loss);
      taped.tape.backward(loss);
      adam.step(step, 50, static_cast<double>(taped.tape.value(loss).scalar()));
    }
    for (const Var<float> leaf : leaves) {
      const std::vector<double> numbers = taped.value(leaf);
      all.insert(all.end(), numbers.begin(), numbers.end());
    }
  });
  return all;
}

/// One round Gaussian over most of a large image.
struct WideGaussian {
  static constexpr int kWidth = 2048, kHeight = 1024;
  static constexpr double kX = 900, kY = 560, kSigma = 800, kOpacity = 0.7;

  static double cotangent(Index pixel) {  // no sum cancels
    const auto x = static_cast<double>(pixel % kWidth) / kWidth;
    return static_cast<double>(static_cast<float>(0.25 + x * x));
  }
};

/// Gradients by colour, opacity and mean.
using WideGradients = std::array<std::vector<double>, 3>;

template <class S>
WideGradients wide_gradients() {
  using G = WideGaussian;
  Tape<S> tape;
  const auto leaf = [&](const char* name, const std::vector<double>& numbers) {
    return stress::leaf(tape, name, shape_of(1, std::ssize(numbers)), numbers);
  };
  const Var<S> means = leaf("means", {G::kX, G::kY}), opacity = leaf("opacity", {static_cast<float>(G::kOpacity)}),
               colour = leaf("colour", {static_cast<float>(0.8)});
  const Projected<S> projected{means, leaf("factors", {G::kSigma, 0, 0, 0, G::kSigma, 0}), leaf("depths", {2}),
                               tape.constant("rest", shape_of(1, 1)), tape.constant("rest", shape_of(1, 2))};
  const SplatView view = front_view(G::kWidth, G::kHeight);
  const Composited<S> out = composite(SplatSet<S>{projected, opacity, colour}, view);
  std::vector<S> cotangent(static_cast<std::size_t>(G::kWidth) * G::kHeight);
  for (std::size_t i = 0; i < cotangent.size(); ++i) cotangent[i] = static_cast<S>(G::cotangent(static_cast<Index>(i)));
  tape.forward(out.channels);
  tape.backward(out.channels, cotangent);
  return {numbers_of<S>(tape.gradient(colour)), numbers_of<S>(tape.gradient(opacity)),
          numbers_of<S>(tape.gradient(means))};
}

/// The same sums pixel by pixel in float.
WideGradients naive_wide_gradients() {
  using G = WideGaussian;
  constexpr float kVariance = static_cast<float>(G::kSigma * G::kSigma + kBlur);
  constexpr auto kColour = 0.8f, kOpacity = static_cast<float>(G::kOpacity);
  float colour = 0, opacity = 0, x = 0, y = 0;
  for (Index pixel = 0; pixel < Index(G::kWidth) * G::kHeight; ++pixel) {
    const float dx = static_cast<float>(pixel % G::kWidth) + 0.5f - static_cast<float>(G::kX);
    const float dy = static_cast<float>(pixel / G::kWidth) + 0.5f - static_cast<float>(G::kY);
    const float g = std::exp(-0.5f * (dx * dx + dy * dy) / kVariance);
    const auto d = static_cast<float>(G::cotangent(pixel));
    if (kOpacity * g < static_cast<float>(kAlphaMin)) continue;
    colour += d * kOpacity * g;
    opacity += d * kColour * g;
    x += d * kColour * kOpacity * g * dx / kVariance;
    y += d * kColour * kOpacity * g * dy / kVariance;
  }
  return {{{static_cast<double>(colour)},
           {static_cast<double>(opacity)},
           {static_cast<double>(x), static_cast<double>(y)}}};
}

/// The number with 11 bits of significand, as half precision keeps it.
float halved(float x) {
  int exponent = 0;
  const float significand = std::frexp(x, &exponent);
  return std::ldexp(std::nearbyint(significand * 2048) / 2048, exponent);
}

}  // namespace

std::vector<StressFigure> sums_by_threads(Remedy remedy) {
  const std::vector<double> first = fitted(1, remedy);
  double different = 0, moved = 0;
  for (const int threads : {1, 2, 3, 8, 16}) {
    for (int run = 0; run < 5; ++run) different += unequal(fitted(threads, remedy), first);
  }
  for (const double x : first) moved += x != 0 ? 1 : 0;
  return {{"parameters that differ on 1, 2, 3, 8 or 16 threads, 5 runs", different, 0},
          {"share of parameters without a value", 1 - moved / static_cast<double>(first.size()), 0.01}};
}

std::vector<StressFigure> sums_over_pixels(Remedy remedy) {
  const WideGradients exact = wide_gradients<double>();
  const WideGradients computed = remedy == Remedy::kOn ? wide_gradients<float>() : naive_wide_gradients();
  return {{"gradient by colour over 2 million pixels, relative", relative_l2(computed[0], exact[0]), 1e-6},
          {"gradient by opacity, relative", relative_l2(computed[1], exact[1]), 1e-6},
          {"gradient by the mean, relative", relative_l2(computed[2], exact[2]), 1e-6}};
}

namespace {

/// The parameters of a scene, by kind.
std::array<std::vector<float>*, 5> kinds_of(Gaussians& g) {
  return {&g.means, &g.quats, &g.log_scales, &g.opacity_logits, &g.sh};
}

/// The image of a scene and the gradients of its mean square.
template <class S>
struct SquaredImage {
  std::vector<double> image;
  std::array<std::vector<double>, 5> gradients;  ///< as kinds_of

  explicit SquaredImage(const Scene& scene) {
    TapedScene<S> taped(scene);
    const Var<S> loss = mean(square(taped.rendered.image));
    taped.tape.forward(loss);
    taped.tape.backward(loss);
    image = taped.value(taped.rendered.image);
    const std::array leaves = {taped.means, taped.quats, taped.log_scales, taped.opacity_logits, taped.sh};
    for (std::size_t k = 0; k < leaves.size(); ++k) gradients[k] = taped.gradient(leaves[k]);
  }
};

}  // namespace

/// F8: without the remedy one kind of parameter at a time is kept in half precision, or the image's gradient is; told
/// is what does the least, so that none could be without breaking the bound.
std::vector<StressFigure> half_precision(Remedy remedy) {
  const Scene scene = small_scene(120, 64, 48, 8);
  const SquaredImage<double> exact(scene);
  const auto errors = [&](const Scene& kept) {
    const SquaredImage<float> computed(kept);
    Largest gradient;
    for (std::size_t k = 0; k < 5; ++k) gradient.add(relative_l2(computed.gradients[k], exact.gradients[k]));
    return std::array{largest_difference(computed.image, exact.image), gradient.value()};
  };
  std::array<double, 2> least = errors(scene);
  for (std::size_t kind = 0; remedy == Remedy::kOff && kind < 5; ++kind) {
    Scene kept = scene;
    for (float& x : *kinds_of(kept.gaussians)[kind]) x = halved(x);
    const std::array<double, 2> of_kind = errors(kept);
    least = kind == 0 ? of_kind : std::array{std::min(least[0], of_kind[0]), std::min(least[1], of_kind[1])};
  }
  return {{"error of the image, of 1", least[0], 1e-6},
          {"gradient by any kind of parameter, relative", least[1], 2e-6}};
}

}  // namespace hsi4d::stress
