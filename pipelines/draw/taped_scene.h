// A scene of Gaussians on a tape, from the numbers of a file to the image.
#pragma once

#include <algorithm>
#include <vector>

#include "autodiff/elementwise.h"
#include "pipelines/draw/image_of_scene.h"
#include "splat/render/covariance.h"
#include "splat/render/opacity.h"
#include "splat/render/render.h"
#include "splat/render/sh.h"

namespace hsi4d {

/// A scene recorded on a tape: all numbers of the Gaussians and the camera are parameters. Sizes are checked by the
/// caller (check_sizes). It stays where it was made.
template <class S>
struct TapedScene {
  TapedScene(const PosedGaussians& posed, const SceneView& scene_view, bool wants_depth) {
    const Gaussians& g = posed.gaussians;
    const Index n = g.count();
    view = {scene_view.camera, origin_of(posed, scene_view.camera), scene_view.settings};
    means = leaf("means", shape_of(n, 3), posed_means(posed, view.origin_world));
    quats = leaf("quats", shape_of(n, 4), {g.quats.begin(), g.quats.end()});
    log_scales = leaf("log_scales", shape_of(n, 3), {g.log_scales.begin(), g.log_scales.end()});
    logits = leaf("opacity_logits", shape_of(n, 1), {g.opacity_logits.begin(), g.opacity_logits.end()});
    sh = leaf("sh", shape_of(n, 3 * g.sh_coefficients()), {g.sh.begin(), g.sh.end()});
    xi = leaf("xi", shape_of(1, 6), std::vector<S>(6));
    const Var<S> background = tape.constant("background", shape_of(1, 3));
    tape.set(background, std::vector<S>(scene_view.background.begin(), scene_view.background.end()));
    Var<S> axes = gaussian_axes(quats, log_scales);
    if (!posed.transforms.empty()) {
      const Var<S> transforms = tape.constant("transforms", shape_of(n, 12));
      tape.set(transforms, std::vector<S>(posed.transforms.begin(), posed.transforms.end()));
      axes = transform_axes(transforms, axes);
    }
    inputs = {means, axes, gaussian_opacities(logits), sh_colors(sh, means, xi, view)};
    RenderRequest request;
    request.depth = wants_depth;
    rendered = render(inputs, xi, background, view, request);
  }

  Var<S> leaf(const char* name, const Shape& shape, const std::vector<S>& values) {
    const Var<S> var = tape.parameter(name, shape);
    tape.set(var, values);
    return var;
  }

  /// What the tape's means are relative to: transforms may put them anywhere in the world, so that the camera is the
  /// one place from which what is seen is near (row A10: far from the origin).
  static Vector3<double> origin_of(const PosedGaussians& posed, const Camera& camera) {
    return posed.transforms.empty() ? posed.gaussians.origin_world : camera_center_world(camera);
  }

  /// A (m + o) + a − origin in double, rounded once; o is what m is relative to.
  static std::vector<S> posed_means(const PosedGaussians& posed, const Vector3<double>& origin) {
    const Gaussians& g = posed.gaussians;
    std::vector<S> result(g.means.begin(), g.means.end());
    for (std::size_t n = 0; 12 * n < posed.transforms.size(); ++n) {
      const double* rows = posed.transforms.data() + 12 * n;
      const Vector3<double> mean = Vector3<float>(g.means.data() + 3 * n).cast<double>() + g.origin_world;
      for (Index r = 0; r < 3; ++r) {
        const double* row = rows + 4 * r;
        const double moved = row[0] * mean[0] + row[1] * mean[1] + row[2] * mean[2] + (row[3] - origin[r]);
        result[3 * n + static_cast<std::size_t>(r)] = static_cast<S>(moved);
      }
    }
    return result;
  }

  /// Of the last backward run; zeros where none arrived.
  std::vector<double> gradient(Var<S> var) const {
    std::vector<double> result(static_cast<std::size_t>(tape.shape(var).count()));
    if (!tape.has_gradient(var)) return result;
    const ConstArray<S> g = tape.gradient(var);
    for (Index r = 0; r < g.total_rows(); ++r) std::copy_n(g.row(r), g.shape.cols, result.begin() + r * g.shape.cols);
    return result;
  }

  /// Sets the gradients of `result` to those of the last backward run.
  void copy_gradients(SceneGradients& result) const {
    result.means = gradient(means);
    result.quats = gradient(quats);
    result.log_scales = gradient(log_scales);
    result.opacity_logits = gradient(logits);
    result.sh = gradient(sh);
    const std::vector<double> of_camera = gradient(xi);
    std::copy(of_camera.begin(), of_camera.end(), result.camera.begin());
  }

  std::vector<PixelTrace> traces(std::span<const PixelPlace> places) const {
    return trace_pixels(tape, rendered.projected, inputs.opacities, inputs.colors, view, places);
  }

  Tape<S> tape;
  SplatView view;
  Var<S> means, quats, log_scales, logits, sh, xi;
  SplatInputs<S> inputs;
  Rendered<S> rendered;
};

/// Numbers of an interleaved image [H,W,3] as planes [3,H,W].
template <class S>
std::vector<S> planar(std::span<const double> interleaved) {
  std::vector<S> result(interleaved.size());
  const std::size_t pixels = interleaved.size() / 3;
  for (std::size_t i = 0; i < interleaved.size(); ++i) result[i % 3 * pixels + i / 3] = static_cast<S>(interleaved[i]);
  return result;
}

/// Interleaved numbers of a planar image [C,H,W].
template <class S>
std::vector<double> interleaved(ConstArray<S> planes) {
  const Shape& s = planes.shape;
  std::vector<double> result(static_cast<std::size_t>(s.count()));
  double* next = result.data();
  for (Index y = 0; y < s.rows; ++y) {
    for (Index x = 0; x < s.cols; ++x) {
      for (Index c = 0; c < s.planes; ++c) *next++ = static_cast<double>(planes(c, y, x));
    }
  }
  return result;
}

}  // namespace hsi4d
