// A test scene on a tape, in float or double, with the loss that its cotangents define; and the same loss of the
// brute-force renderer.
#pragma once

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "autodiff/elementwise.h"
#include "autodiff/reduce.h"
#include "body/skinning.h"
#include "splat/render/covariance.h"
#include "splat/render/opacity.h"
#include "splat/render/render.h"
#include "splat/render/sh.h"
#include "stress/tape_numbers.h"
#include "tests/support/measures.h"
#include "tests/support/splat_scenes.h"

namespace hsi4d::test {

/// d loss / d what is rendered, in double: colour and group opacities planar [·,H,W], transmittance and depth [H,W].
/// Empty: not part of the loss.
struct SplatCotangent {
  std::vector<double> image, transmittance, depth, groups;
};

/// Random numbers in [−1, 1], floats.
inline std::vector<double> random_cotangent(Index count, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::vector<double> numbers(static_cast<std::size_t>(count));
  for (double& x : numbers) x = static_cast<float>(2 * (static_cast<double>(random() >> 11) * 0x1p-53) - 1);
  return numbers;
}

/// Named arrays of numbers: gradients by class, or planes of a render.
struct NamedNumbers {
  std::string name;
  std::vector<double> numbers;
};

/// Relative errors of a class of gradients.
struct ClassError {
  std::string name;
  double all = 0;        ///< L2
  double worst_row = 0;  ///< see worst_row_error
};

/// Errors of gradients by class; a row is a Gaussian, or all numbers of what there is once. The gradient of quaternions
/// is zero but for rounding where Gaussians are round: if it is below 1e-6 of the log-scales', it is measured against
/// that.
inline std::vector<ClassError> gradient_errors(const std::vector<NamedNumbers>& computed,
                                               const std::vector<NamedNumbers>& expected) {
  const auto numbers_named = [&](const std::string& name) {
    for (const NamedNumbers& e : expected) {
      if (e.name == name) return e.numbers;
    }
    return std::vector<double>();
  };
  const auto norm = [](const std::vector<double>& x) { return relative_l2(x, std::vector<double>(x.size(), 0.0)); };
  const std::size_t gaussians = numbers_named("opacity_logits").size();
  const std::vector<double> log_scales = numbers_named("log_scales");
  std::vector<ClassError> errors;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    const auto& [name, numbers] = expected[i];
    const std::size_t rows = name == "camera" || name == "background" ? 1 : gaussians;
    const double own = norm(numbers);
    const bool is_round = name == "quats" && own < 1e-6 * norm(log_scales);
    const double error = relative_l2(computed[i].numbers, numbers), size = is_round ? norm(log_scales) : own;
    errors.push_back(
        {name, own > 0 ? error * own / size : error,
         worst_row_error(computed[i].numbers, numbers, rows, median_row(is_round ? log_scales : numbers, rows))});
  }
  return errors;
}

using stress::numbers_of;

/// Every family of settings whose numbers differ, applied to those of a scene; the scene's `near` is not lowered.
struct SettingsVariant {
  std::string name;
  void (*change)(RenderSettings&);
  void apply(RenderSettings& settings) const {
    const double near = settings.near;
    change(settings);
    settings.near = std::max(near, settings.near);
  }
};

inline std::vector<SettingsVariant> settings_variants() {
  return {
      {"default", [](RenderSettings&) {}},
      {"accurate", [](RenderSettings& s) { apply_quality(s, Quality::kAccurate); }},
      {"reference", [](RenderSettings& s) { apply_quality(s, Quality::kReference); }},
      {"gsplat", [](RenderSettings& s) { apply_compatibility(s, Compatibility::kGsplat); }},
      {"inria", [](RenderSettings& s) { apply_compatibility(s, Compatibility::kInria); }},
      {"antialias", [](RenderSettings& s) { s.antialias = true; }},
      {"antialias, reference, hardly any blur",
       [](RenderSettings& s) {
         apply_quality(s, Quality::kReference);
         s.antialias = true;
         s.blur = 0.01;
       }},
      {"small tiles, degree 1, float keys",
       [](RenderSettings& s) {
         s.tile = 8;
         s.sh_degree = 1;
         s.depth_key = DepthKey::kFloat;
       }},
      {"inria in small tiles, inclusive",
       [](RenderSettings& s) {
         apply_compatibility(s, Compatibility::kInria);
         s.stop_rule = StopRule::kInclusive;
         s.tile = 8;
       }},
  };
}

/// Random cotangents for a render of `camera`.
inline SplatCotangent cotangent_of(const Camera& camera, Index groups = 0, bool depth = false) {
  const Index pixels = static_cast<Index>(camera.width) * camera.height;
  SplatCotangent d;
  d.image = random_cotangent(3 * pixels, 1);
  d.transmittance = random_cotangent(pixels, 2);
  if (depth) d.depth = random_cotangent(pixels, 3);
  if (groups > 0) d.groups = random_cotangent(groups * pixels, 4);
  return d;
}

template <class S>
class TapedSplats {
 public:
  Tape<S> tape;
  Var<S> means, quats, log_scales, opacity_logits, sh, xi, background, transforms;
  SplatView view;
  Var<S> opacities, colors;
  Rendered<S> rendered;
  Var<S> loss;

  /// @param request     what to render beside the image
  /// @param transforms  empty, or [N,12] of each Gaussian
  /// @param origin      the means are stored relative to it
  TapedSplats(const SplatScene& scene, const SplatCotangent& cotangent, const RenderRequest& request = {},
              const std::vector<float>& moved_by = {}, const Vector3<double>& origin = Vector3<double>::Zero())
      : view{scene.camera, origin, scene.settings} {
    const Index n = scene.count(), k = scene.sh_coefficients();
    means = leaf("means", shape_of(n, 3), scene.means);
    quats = leaf("quats", shape_of(n, 4), scene.quats);
    log_scales = leaf("log_scales", shape_of(n, 3), scene.log_scales);
    opacity_logits = leaf("opacity_logits", shape_of(n, 1), scene.opacity_logits);
    sh = leaf("sh", shape_of(n, 3 * k), scene.sh);
    xi = tape.parameter("xi", shape_of(1, 6));
    background = leaf("background", shape_of(1, 3), {scene.background.begin(), scene.background.end()});
    Var<S> placed = means, axes = gaussian_axes(quats, log_scales);
    if (!moved_by.empty()) {
      transforms = leaf("transforms", shape_of(n, 12), moved_by);
      placed = transform_points(transforms, means);
      axes = transform_axes(transforms, axes);
    }
    opacities = gaussian_opacities(opacity_logits);
    colors = sh_colors(sh, placed, xi, view);
    rendered = render<S>({placed, axes, opacities, colors}, xi, background, view, request);
    add_term(rendered.image, cotangent.image);
    add_term(rendered.transmittance, cotangent.transmittance);
    if (request.depth) add_term(rendered.depth, cotangent.depth);
    if (!request.groups.empty()) add_term(rendered.group_opacity, cotangent.groups);
  }

  /// All that may be written, but for the weights of the loss.
  std::vector<Var<S>> leaves() const {
    std::vector<Var<S>> all = {means, quats, log_scales, opacity_logits, sh, xi, background};
    if (transforms.tape != nullptr) all.push_back(transforms);
    return all;
  }

  void run() {
    tape.forward(loss);
    tape.backward(loss);
  }
  /// Runs with the means of the rows in reverse, then as it was: nothing that a run leaves behind may matter.
  void run_after_another() {
    const std::vector<double> here = value(means);
    std::vector<S> numbers(here.begin(), here.end()), reversed(numbers.rbegin(), numbers.rend());
    for (std::size_t i = 0; i < reversed.size(); i += 3) std::swap(reversed[i], reversed[i + 2]);
    tape.set(means, reversed);
    run();
    tape.set(means, numbers);
    run();
  }

  std::vector<double> value(Var<S> of) const { return numbers_of<S>(tape.value(of)); }
  std::vector<double> gradient(Var<S> of) const { return numbers_of<S>(tape.gradient(of)); }

  std::vector<NamedNumbers> gradients() const {
    std::vector<NamedNumbers> all;
    for (const auto& [name, var] :
         {std::pair("means", means), std::pair("quats", quats), std::pair("log_scales", log_scales),
          std::pair("opacity_logits", opacity_logits), std::pair("sh", sh), std::pair("camera", xi),
          std::pair("background", background), std::pair("transforms", transforms)}) {
      if (var.tape != nullptr) all.push_back({name, gradient(var)});
    }
    return all;
  }

 private:
  Var<S> leaf(const char* name, const Shape& shape, const std::vector<float>& numbers) {
    return stress::leaf(tape, name, shape, numbers);
  }
  void add_term(Var<S> image, const std::vector<double>& weights) {
    if (weights.empty()) return;
    const Var<S> weight = tape.constant("cotangent", image.shape());
    tape.set(weight, std::vector<S>(weights.begin(), weights.end()));
    const Var<S> term = sum(image * weight);
    loss = loss.tape == nullptr ? term : loss + term;
  }
};

/// The brute-force renderer's Σ w = 1 − T cancels in pixels less opaque than this: their depth is left out of the loss.
inline constexpr double kOpaqueEnough = 1e-3;

/// What the brute-force renderer makes of a scene: the same planes and classes of gradients as TapedSplats, in its
/// order.
struct ReferenceResult {
  std::vector<double> image, transmittance, depth, groups;
  std::vector<NamedNumbers> gradients;
};

/// @tparam T      what the brute-force renderer computes in: double or long double
/// @param groups  rows of each group, as in RenderRequest; they must not overlap
template <class T = double>
ReferenceResult reference_result(const SplatScene& scene, const SplatCotangent& cotangent,
                                 const RenderRequest& request = {}, const std::vector<float>& moved_by = {}) {
  reference::Scene<T> input = reference_scene<T>(scene);
  input.transforms.assign(moved_by.begin(), moved_by.end());
  if (!request.groups.empty()) {
    input.groups.assign(static_cast<std::size_t>(scene.count()), -1);
    for (std::size_t g = 0; g < request.groups.size(); ++g) {
      for (Index n = request.groups[g].first; n < request.groups[g].second; ++n) {
        input.groups[static_cast<std::size_t>(n)] = static_cast<int>(g);
      }
    }
  }
  const reference::Pinhole<T> camera = reference_pinhole<T>(scene.camera);
  const std::array<T, 3> background = reference_background<T>(scene);
  const reference::Image<T> image = reference::render(input, camera, background, scene.settings);
  const std::size_t pixels = image.transmittance.size();
  ReferenceResult result;
  const auto narrow = [](const auto& x) {
    std::vector<double> y;
    for (const T v : x) y.push_back(static_cast<double>(v));
    return y;
  };
  result.transmittance = narrow(image.transmittance);
  result.groups = narrow(image.group_opacity);
  result.image.resize(3 * pixels);
  result.depth.resize(pixels);
  reference::Image<T> d;
  d.transmittance.assign(cotangent.transmittance.begin(), cotangent.transmittance.end());
  d.transmittance.resize(pixels);
  d.depth_sum.assign(pixels, 0);
  d.color.assign(3 * pixels, 0);
  d.group_opacity.assign(cotangent.groups.begin(), cotangent.groups.end());
  for (std::size_t p = 0; p < pixels; ++p) {
    for (std::size_t c = 0; c < 3; ++c) {
      result.image[c * pixels + p] = static_cast<double>(image.color[3 * p + c]);
      if (!cotangent.image.empty()) d.color[3 * p + c] = cotangent.image[c * pixels + p];
    }
    // E = D/A, A = 1 − T
    const T opacity = 1 - image.transmittance[p];
    if (!(opacity > 0)) continue;
    const T depth = image.depth_sum[p] / opacity;
    result.depth[p] = static_cast<double>(depth);
    if (!request.depth || cotangent.depth.empty() || opacity < kOpaqueEnough) continue;
    d.depth_sum[p] = cotangent.depth[p] / opacity;
    d.transmittance[p] += cotangent.depth[p] * depth / opacity;
  }
  const auto g = reference::gradients(input, camera, background, scene.settings, d);
  result.gradients = {{"means", narrow(g.means)},
                      {"quats", narrow(g.quats)},
                      {"log_scales", narrow(g.log_scales)},
                      {"opacity_logits", narrow(g.opacity_logits)},
                      {"sh", narrow(g.sh)},
                      {"camera", narrow(g.camera)},
                      {"background", narrow(g.background)}};
  if (!g.transforms.empty()) result.gradients.push_back({"transforms", narrow(g.transforms)});
  return result;
}

}  // namespace hsi4d::test
