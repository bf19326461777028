#include "pipelines/draw/reference_render.h"

#include <utility>

#include "core/check.h"
#include "splat/reference/reference.h"

namespace hsi4d {
namespace {

std::vector<double> numbers(std::span<const float> values) { return {values.begin(), values.end()}; }

reference::Scene<double> reference_scene(const PosedGaussians& posed) {
  const Gaussians& g = posed.gaussians;
  reference::Scene<double> scene;
  scene.n = g.count();
  scene.sh_coefficients = g.sh_coefficients();
  scene.means = numbers(g.means);
  for (std::size_t i = 0; i < scene.means.size(); ++i) scene.means[i] += g.origin_world[static_cast<Index>(i % 3)];
  scene.quats = numbers(g.quats);
  scene.log_scales = numbers(g.log_scales);
  scene.opacity_logits = numbers(g.opacity_logits);
  scene.sh = numbers(g.sh);
  scene.transforms = posed.transforms;
  scene.groups.assign(static_cast<std::size_t>(scene.n), 0);  // its opacity is Σ w, without the cancellation of 1 − T
  return scene;
}

reference::Pinhole<double> reference_camera(const Camera& camera) {
  reference::Pinhole<double> pinhole{camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy, {}};
  const Matrix4<double> matrix = matrix_from_rigid(camera.camera_from_world);
  for (int i = 0; i < 12; ++i) pinhole.camera_from_world[static_cast<std::size_t>(i)] = matrix(i / 4, i % 4);
  return pinhole;
}

SceneImage reference_image_of(const reference::Image<double>& rendered, const Camera& camera) {
  SceneImage result{camera.width, camera.height, rendered.color, rendered.transmittance, {}, {}, {}};
  for (double& alpha : result.alpha) alpha = 1 - alpha;
  result.depth.resize(rendered.transmittance.size());
  for (std::size_t i = 0; i < rendered.group_opacity.size(); ++i) {
    const double weight = rendered.group_opacity[i];
    if (weight > 0) result.depth[i] = rendered.depth_sum[i] / weight;
  }
  return result;
}

PixelSplat traced_splat(const reference::Fragment<double>& f, double cap) {
  return {f.gaussian, f.depth, f.uncapped, f.alpha, f.uncapped > cap, f.transmittance, f.color, {}};
}

PixelTrace trace_of(const reference::PixelFragments<double>& pixel, PixelPlace place, double cap) {
  PixelTrace trace;
  trace.place = place;
  for (const auto& fragment : pixel.composited) trace.add(traced_splat(fragment, cap));
  for (const auto& fragment : pixel.skipped) trace.skip(traced_splat(fragment, cap));
  for (const auto& fragment : pixel.refused) trace.refused = traced_splat(fragment, cap);
  trace.stopped = pixel.stopped;
  trace.behind_stop = pixel.behind_stop;
  trace.transmittance = pixel.transmittance;
  return trace;
}

}  // namespace

SceneImage render_reference(const PosedGaussians& posed, const SceneView& view, std::span<const PixelPlace> traced) {
  const reference::Scene<double> scene = reference_scene(posed);
  const reference::Pinhole<double> camera = reference_camera(view.camera);
  SceneImage result = reference_image_of(reference::render(scene, camera, view.background, view.settings), view.camera);
  for (const PixelPlace place : traced) {
    const auto pixel = reference::fragments(scene, camera, view.settings, place.row, place.column);
    result.traces.push_back(trace_of(pixel, place, view.settings.alpha_cap));
  }
  return result;
}

SceneGradients adjoint_reference(const Gaussians& gaussians, const SceneView& view, const CotangentOf& cotangent_of) {
  const reference::Scene<double> scene = reference_scene({gaussians, {}});
  const reference::Pinhole<double> camera = reference_camera(view.camera);
  SceneGradients result;
  result.rendered = reference_image_of(reference::render(scene, camera, view.background, view.settings), view.camera);
  reference::Image<double> cotangent;
  cotangent.color = cotangent_of(result);
  HSI4D_CHECK_EQ(cotangent.color.size(), result.rendered.image.size());
  reference::Gradients<double> g = reference::gradients(scene, camera, view.background, view.settings, cotangent);
  result.means = std::move(g.means);
  result.quats = std::move(g.quats);
  result.log_scales = std::move(g.log_scales);
  result.opacity_logits = std::move(g.opacity_logits);
  result.sh = std::move(g.sh);
  result.camera = g.camera;
  return result;
}

}  // namespace hsi4d
