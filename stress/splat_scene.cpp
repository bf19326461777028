#include "stress/splat_scene.h"

#include <cmath>

#include "autodiff/elementwise.h"
#include "autodiff/reduce.h"
#include "core/random.h"
#include "splat/render/covariance.h"
#include "splat/render/opacity.h"
#include "splat/render/sh.h"
#include "stress/measures.h"
#include "stress/tape_numbers.h"

namespace hsi4d::stress {

namespace {

constexpr double kY00 = 0.28209479177387814;  // the constant harmonic

/// Σ x w, with weights of their own stream.
template <class S>
Var<S> weighted_sum(Var<S> x, std::uint64_t stream) {
  const Random random(7, stream);
  std::vector<S> weights(static_cast<std::size_t>(x.shape().count()));
  for (std::size_t i = 0; i < weights.size(); ++i) weights[i] = static_cast<S>(2 * random.uniform<float>(i) - 1);
  const Var<S> weight = x.owner().constant("weights", x.shape());
  x.owner().set(weight, weights);
  return sum(x * weight);
}

}  // namespace

void Scene::add(const Vector3<double>& mean, const Vector3<double>& scales, double opacity_logit,
                const std::array<double, 3>& color) {
  for (int i = 0; i < 3; ++i) gaussians.means.push_back(static_cast<float>(mean[i]));
  gaussians.quats.insert(gaussians.quats.end(), {1, 0, 0, 0});
  for (int i = 0; i < 3; ++i) gaussians.log_scales.push_back(static_cast<float>(std::log(scales[i])));
  gaussians.opacity_logits.push_back(static_cast<float>(opacity_logit));
  for (const double c : color) gaussians.sh.push_back(static_cast<float>((c - 0.5) / kY00));
  gaussians.sh.resize(gaussians.opacity_logits.size() * static_cast<std::size_t>(3 * gaussians.sh_coefficients()));
}

Camera tilted_camera(int width, int height) {
  Camera camera = front_camera(width, height);
  camera.camera_from_world = look_at({1.2, -3.6, 1.3}, {0, 0, 0});
  return camera;
}

Scene empty_scene(const Camera& camera) {
  Scene scene;
  scene.camera = camera;
  return scene;
}

Scene random_scene(Index n, std::uint64_t seed, int width, int height) {
  Scene scene = empty_scene(tilted_camera(width, height));
  Gaussians& g = scene.gaussians;
  g.sh_degree = kHighestShDegree;
  RandomSequence random(seed, random_stream("stress scene"));
  const auto number = [&](double low, double high) { return static_cast<float>(random.uniform(low, high)); };
  for (Index i = 0; i < n; ++i) {
    const double radius = 1.6 * std::cbrt(random.uniform());
    const Vector4<double> direction = random.rotation(), q = random.rotation();
    const double length = std::sqrt(1 - direction[0] * direction[0]);
    for (int k = 1; k < 4; ++k) g.means.push_back(static_cast<float>(radius * direction[k] / length));
    for (int k = 0; k < 4; ++k) g.quats.push_back(static_cast<float>(q[k]));
    for (int k = 0; k < 3; ++k) g.log_scales.push_back(number(std::log(0.03), std::log(0.5)));
    g.opacity_logits.push_back(number(-3, 3));
    for (int k = 0; k < 3 * g.sh_coefficients(); ++k) {
      g.sh.push_back(k < 3 ? number(-0.4 / kY00, 0.4 / kY00) : static_cast<float>(0.1 * random.normal()));
    }
  }
  return scene;
}

Scene small_scene(Index n, int width, int height, std::uint64_t seed) {
  Scene scene = empty_scene(front_camera(width, height));
  scene.background = {0.2F, 0.3F, 0.4F};
  Gaussians& g = scene.gaussians;
  g.sh_degree = 1;
  RandomSequence random(seed);
  const auto add = [&](std::vector<float>& to, double low, double high) {
    to.push_back(static_cast<float>(random.uniform(low, high)));
  };
  for (Index i = 0; i < n; ++i) {
    const double z = random.uniform(2, 5), half = 0.5 * z, aspect = static_cast<double>(height) / width;
    add(g.means, -half, half);
    add(g.means, -half * aspect, half * aspect);
    add(g.means, z, z + 1e-3);
    for (int k = 0; k < 4; ++k) add(g.quats, -1, 1);
    const double pixel = z / width;
    for (int k = 0; k < 3; ++k) add(g.log_scales, std::log(pixel), std::log(5 * pixel));
    add(g.opacity_logits, -1, 3);
    for (int k = 0; k < 12; ++k) add(g.sh, k < 3 ? -1 : -0.2, k < 3 ? 1.5 : 0.2);
  }
  return scene;
}

Scene scaled(Scene scene, double factor) {
  for (float& x : scene.gaussians.means) x = static_cast<float>(x * factor);
  for (float& x : scene.gaussians.log_scales) x = static_cast<float>(x + std::log(factor));
  scene.camera.camera_from_world.translation *= factor;
  scene.settings.near *= factor;
  return scene;
}

Scene translated(Scene scene, const Vector3<double>& offset) {
  scene.camera.camera_from_world.translation -= scene.camera.camera_from_world.rotation * offset;
  scene.gaussians.origin_world += offset;
  return scene;
}

Scene in_world(Scene scene) {
  Gaussians& g = scene.gaussians;
  for (std::size_t i = 0; i < g.means.size(); ++i) {
    g.means[i] = static_cast<float>(g.means[i] + g.origin_world[static_cast<Index>(i % 3)]);
  }
  g.origin_world = Vector3<double>::Zero();
  return scene;
}

template <class S>
TapedScene<S>::TapedScene(const Scene& scene, const std::vector<double>& given_axes, const RenderRequest& request)
    : view{scene.camera, scene.gaussians.origin_world, scene.settings} {
  const Gaussians& g = scene.gaussians;
  const Index n = g.count();
  const auto leaf = [this](const char* name, const Shape& shape, const auto& numbers) {
    return stress::leaf(tape, name, shape, numbers);
  };
  means = leaf("means", shape_of(n, 3), g.means);
  quats = leaf("quats", shape_of(n, 4), g.quats);
  log_scales = leaf("log_scales", shape_of(n, 3), g.log_scales);
  opacity_logits = leaf("opacity_logits", shape_of(n, 1), g.opacity_logits);
  sh = leaf("sh", shape_of(n, 3 * g.sh_coefficients()), g.sh);
  xi = tape.parameter("xi", shape_of(1, 6));
  background = leaf("background", shape_of(1, 3), scene.background);
  axes = given_axes.empty() ? gaussian_axes(quats, log_scales) : leaf("axes", shape_of(n, 9), given_axes);
  opacities = gaussian_opacities(opacity_logits);
  colors = sh_colors(sh, means, xi, view);
  rendered = render<S>({means, axes, opacities, colors}, xi, background, view, request);
  loss = weighted_sum(rendered.image, 1) + weighted_sum(rendered.transmittance, 2);
}

template <class S>
void TapedScene<S>::run() {
  tape.forward(loss);
  tape.backward(loss);
}

template <class S>
std::vector<double> TapedScene<S>::value(Var<S> of) const {
  return numbers_of<S>(tape.value(of));
}

template <class S>
std::vector<double> TapedScene<S>::gradient(Var<S> of) const {
  return tape.has_gradient(of) ? numbers_of<S>(tape.gradient(of)) : std::vector<double>{};
}

template struct TapedScene<float>;
template struct TapedScene<double>;

std::vector<double> Rendering::gradients() const {
  std::vector<double> all;
  for (const auto* part : {&means, &quats, &log_scales, &opacity_logits, &sh, &camera}) {
    all.insert(all.end(), part->begin(), part->end());
  }
  return all;
}

template <class S>
Rendering render_scene(const Scene& scene, const std::vector<double>& axes) {
  TapedScene<S> taped(scene, axes);
  taped.run();
  return {taped.value(taped.rendered.image), taped.value(taped.rendered.transmittance),
          taped.gradient(taped.means),       taped.gradient(taped.quats),
          taped.gradient(taped.log_scales),  taped.gradient(taped.opacity_logits),
          taped.gradient(taped.sh),          taped.gradient(taped.xi)};
}

template Rendering render_scene<float>(const Scene&, const std::vector<double>&);
template Rendering render_scene<double>(const Scene&, const std::vector<double>&);

std::vector<double> exact_image(const Scene& scene) {
  TapedScene<double> taped(scene);
  taped.tape.forward(taped.rendered.image);
  return taped.value(taped.rendered.image);
}

double crop_difference(const Scene& whole, const Scene& part, int left, int top) {
  const std::vector<double> image = render_scene<float>(whole).image, window = render_scene<float>(part).image;
  const int width = part.camera.width, height = part.camera.height;
  Largest difference;
  for (int i = 0; i < 3 * width * height; ++i) {
    const int col = i % width + left, row = i / width % height + top, plane = i / (width * height);
    const int place = (plane * whole.camera.height + row) * whole.camera.width + col;
    difference.add(std::abs(window[static_cast<std::size_t>(i)] - image[static_cast<std::size_t>(place)]));
  }
  return difference.value();
}

reference::Scene<double> reference_scene(const Scene& scene) {
  const Gaussians& g = scene.gaussians;
  const auto wide = [](const std::vector<float>& x) { return std::vector<double>(x.begin(), x.end()); };
  reference::Scene<double> result;
  result.n = g.count();
  result.sh_coefficients = g.sh_coefficients();
  result.means = wide(g.means);
  result.quats = wide(g.quats);
  result.log_scales = wide(g.log_scales);
  result.opacity_logits = wide(g.opacity_logits);
  result.sh = wide(g.sh);
  return result;
}

reference::Pinhole<double> reference_pinhole(const Camera& camera) {
  const Rigid<double>& pose = camera.camera_from_world;
  reference::Pinhole<double> result{camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy, {}};
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 4; ++c) {
      result.camera_from_world[static_cast<std::size_t>(4 * r + c)] = c < 3 ? pose.rotation(r, c) : pose.translation[r];
    }
  }
  return result;
}

Rendering reference_rendering(const Scene& scene) {
  const std::array<double, 3> background = {scene.background[0], scene.background[1], scene.background[2]};
  const reference::Image<double> image =
      reference::render(reference_scene(scene), reference_pinhole(scene.camera), background, scene.settings);
  Rendering result;
  result.transmittance = image.transmittance;
  const std::size_t pixels = image.transmittance.size();
  result.image.resize(3 * pixels);
  for (std::size_t i = 0; i < 3 * pixels; ++i) result.image[i] = image.color[3 * (i % pixels) + i / pixels];
  return result;
}

}  // namespace hsi4d::stress
