#include "pipelines/scene_render.h"

#include <algorithm>

#include "autodiff/elementwise.h"
#include "core/check.h"
#include "core/parallel.h"
#include "splat/covariance.h"
#include "splat/opacity.h"
#include "splat/reference.h"
#include "splat/render.h"
#include "splat/sh.h"

namespace hsi4d {
namespace {

std::size_t pixels_of(const Camera& camera) {
  return static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
}

template <class S>
std::vector<S> cast(std::span<const float> values) {
  return {values.begin(), values.end()};
}

void check_scene(const PosedGaussians& scene) {
  check_sizes(scene.gaussians);
  const std::size_t count = scene.transforms.size();
  HSI4D_CHECK(count == 0 || count == 12 * static_cast<std::size_t>(scene.gaussians.count()),
              std::to_string(count) + " numbers are no transforms of these Gaussians");
}

/// Mean squared difference, and its derivatives by the image: 2 (image − target) / count.
double squared_loss(std::span<const double> image, std::span<const double> target, std::vector<double>& cotangent) {
  HSI4D_CHECK_EQ(image.size(), target.size());
  const auto count = static_cast<double>(image.size());
  std::vector<double> squares(image.size());
  cotangent.resize(image.size());
  for (std::size_t i = 0; i < image.size(); ++i) {
    const double difference = image[i] - target[i];
    squares[i] = difference * difference;
    cotangent[i] = 2 * difference / count;
  }
  return pairwise_sum(squares.data(), static_cast<Index>(squares.size())) / count;
}

// --- the taped renderer ----------------------------------------------------------------------------------------------

/// A scene recorded on a tape.
template <class S>
struct TapedScene {
  TapedScene(const PosedGaussians& posed, const SceneView& scene_view, bool wants_depth) {
    const Gaussians& g = posed.gaussians;
    const Index n = g.count();
    view = {scene_view.camera, origin_of(posed, scene_view.camera), scene_view.settings};
    means = leaf("means", shape_of(n, 3), posed_means(posed, view.origin_world));
    quats = leaf("quats", shape_of(n, 4), cast<S>(g.quats));
    log_scales = leaf("log_scales", shape_of(n, 3), cast<S>(g.log_scales));
    logits = leaf("opacity_logits", shape_of(n, 1), cast<S>(g.opacity_logits));
    sh = leaf("sh", shape_of(n, 3 * g.sh_coefficients()), cast<S>(g.sh));
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
  /// one place from which what is seen is near (row A10).
  static Vector3<double> origin_of(const PosedGaussians& posed, const Camera& camera) {
    return posed.transforms.empty() ? posed.gaussians.origin_world : camera_center_world(camera);
  }

  /// A (m + o) + a − origin in double, rounded once; o is what m is relative to.
  static std::vector<S> posed_means(const PosedGaussians& posed, const Vector3<double>& origin) {
    const Gaussians& g = posed.gaussians;
    std::vector<S> result = cast<S>(g.means);
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

  std::vector<double> gradient(Var<S> var) const {
    std::vector<double> result(static_cast<std::size_t>(tape.shape(var).count()));
    if (!tape.has_gradient(var)) return result;
    const ConstArray<S> g = tape.gradient(var);
    for (Index r = 0; r < g.total_rows(); ++r) std::copy_n(g.row(r), g.shape.cols, result.begin() + r * g.shape.cols);
    return result;
  }

  PixelTrace trace(PixelPlace place) const {
    return trace_pixel(tape, rendered.projected, inputs.opacities, inputs.colors, view, place);
  }

  Tape<S> tape;
  SplatView view;
  Var<S> means, quats, log_scales, logits, sh, xi;
  SplatInputs<S> inputs;
  Rendered<S> rendered;
};

/// Interleaved numbers of a planar image [C,H,W].
template <class S>
std::vector<double> interleaved(ConstArray<S> planar) {
  const Shape& s = planar.shape;
  std::vector<double> result(static_cast<std::size_t>(s.count()));
  double* next = result.data();
  for (Index y = 0; y < s.rows; ++y) {
    for (Index x = 0; x < s.cols; ++x) {
      for (Index c = 0; c < s.planes; ++c) *next++ = static_cast<double>(planar(c, y, x));
    }
  }
  return result;
}

template <class S>
SceneImage image_of(const TapedScene<S>& scene, const Camera& camera) {
  const Rendered<S>& rendered = scene.rendered;
  SceneImage result{camera.width,
                    camera.height,
                    interleaved(scene.tape.value(rendered.image)),
                    interleaved(scene.tape.value(rendered.transmittance)),
                    {},
                    {},
                    {}};
  for (double& alpha : result.alpha) alpha = static_cast<double>(static_cast<S>(1 - alpha));
  result.drawn = rendered.counters->visible;
  if (rendered.depth.tape) result.depth = interleaved(scene.tape.value(rendered.depth));
  return result;
}

template <class S>
void freeze_all(TapedScene<S>& scene) {
  for (const Var<S> var : {scene.means, scene.quats, scene.log_scales, scene.logits, scene.sh, scene.xi})
    scene.tape.freeze(var);
}

template <class S>
ScenePicture picture_taped(const PosedGaussians& posed, const SceneView& view) {
  TapedScene<S> scene(posed, view, false);
  freeze_all(scene);
  scene.tape.forward(scene.rendered.image);
  scene.tape.forward(scene.rendered.transmittance);
  ScenePicture picture{Image(3, view.camera.height, view.camera.width), false, scene.rendered.counters->visible};
  const ConstArray<S> image = scene.tape.value(scene.rendered.image),
                      t = scene.tape.value(scene.rendered.transmittance);
  for (int y = 0; y < view.camera.height; ++y) {
    for (int c = 0; c < 3; ++c) {
      for (int x = 0; x < view.camera.width; ++x) picture.image(c, y, x) = static_cast<float>(image(c, y, x));
    }
    picture.shows_something |= std::any_of(t.row(y), t.row(y) + view.camera.width, [](S at) { return 1 - at > 0; });
  }
  return picture;
}

template <class S>
SceneImage render_taped(const PosedGaussians& posed, const SceneView& view, std::span<const PixelPlace> traced) {
  TapedScene<S> scene(posed, view, true);
  freeze_all(scene);
  scene.tape.forward(scene.rendered.depth);
  scene.tape.forward(scene.rendered.image);
  scene.tape.forward(scene.rendered.transmittance);
  SceneImage result = image_of(scene, view.camera);
  for (const PixelPlace place : traced) result.traces.push_back(scene.trace(place));
  return result;
}

template <class S>
SceneGradients gradients_taped(const Gaussians& gaussians, const SceneView& view, std::span<const double> target) {
  TapedScene<S> scene({gaussians, {}}, view, false);
  scene.tape.forward(scene.rendered.transmittance);
  scene.tape.forward(scene.rendered.image);
  SceneGradients result;
  result.rendered = image_of(scene, view.camera);
  std::vector<double> cotangent;
  result.loss = squared_loss(result.rendered.image, target, cotangent);
  std::vector<S> planar(cotangent.size());  // [3,H,W]
  const std::size_t pixels = pixels_of(view.camera);
  for (std::size_t i = 0; i < cotangent.size(); ++i) planar[i % 3 * pixels + i / 3] = static_cast<S>(cotangent[i]);
  scene.tape.backward(scene.rendered.image, planar);
  result.means = scene.gradient(scene.means);
  result.quats = scene.gradient(scene.quats);
  result.log_scales = scene.gradient(scene.log_scales);
  result.opacity_logits = scene.gradient(scene.logits);
  result.sh = scene.gradient(scene.sh);
  const std::vector<double> camera = scene.gradient(scene.xi);
  std::copy(camera.begin(), camera.end(), result.camera.begin());
  return result;
}

// --- the brute-force renderer ----------------------------------------------------------------------------------------

reference::Scene<double> reference_scene(const PosedGaussians& posed) {
  const Gaussians& g = posed.gaussians;
  reference::Scene<double> scene;
  scene.n = g.count();
  scene.sh_coefficients = g.sh_coefficients();
  scene.means = cast<double>(g.means);
  for (std::size_t i = 0; i < scene.means.size(); ++i) scene.means[i] += g.origin_world[static_cast<Index>(i % 3)];
  scene.quats = cast<double>(g.quats);
  scene.log_scales = cast<double>(g.log_scales);
  scene.opacity_logits = cast<double>(g.opacity_logits);
  scene.sh = cast<double>(g.sh);
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

SceneImage image_of(const reference::Image<double>& rendered, const Camera& camera) {
  SceneImage result{camera.width, camera.height, rendered.color, rendered.transmittance, {}, {}, {}};
  for (double& alpha : result.alpha) alpha = 1 - alpha;
  result.depth.resize(pixels_of(camera));
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

SceneImage render_reference(const PosedGaussians& posed, const SceneView& view, std::span<const PixelPlace> traced) {
  const reference::Scene<double> scene = reference_scene(posed);
  const reference::Pinhole<double> camera = reference_camera(view.camera);
  SceneImage result = image_of(reference::render(scene, camera, view.background, view.settings), view.camera);
  for (const PixelPlace place : traced) {
    const auto pixel = reference::fragments(scene, camera, view.settings, place.row, place.column);
    result.traces.push_back(trace_of(pixel, place, view.settings.alpha_cap));
  }
  return result;
}

SceneGradients gradients_reference(const Gaussians& gaussians, const SceneView& view, std::span<const double> target) {
  const reference::Scene<double> scene = reference_scene({gaussians, {}});
  const reference::Pinhole<double> camera = reference_camera(view.camera);
  SceneGradients result;
  result.rendered = image_of(reference::render(scene, camera, view.background, view.settings), view.camera);
  reference::Image<double> cotangent;
  result.loss = squared_loss(result.rendered.image, target, cotangent.color);
  reference::Gradients<double> g = reference::gradients(scene, camera, view.background, view.settings, cotangent);
  result.means = std::move(g.means);
  result.quats = std::move(g.quats);
  result.log_scales = std::move(g.log_scales);
  result.opacity_logits = std::move(g.opacity_logits);
  result.sh = std::move(g.sh);
  result.camera = g.camera;
  return result;
}

}  // namespace

bool shows_something(const SceneImage& rendered) {
  return std::any_of(rendered.alpha.begin(), rendered.alpha.end(), [](double alpha) { return alpha > 0; });
}

SceneImage render_scene(const PosedGaussians& scene, const SceneView& view, std::span<const PixelPlace> traced) {
  check_scene(scene);
  switch (view.precision) {
    case Precision::kFloat:
      return render_taped<float>(scene, view, traced);
    case Precision::kDouble:
      return render_taped<double>(scene, view, traced);
    case Precision::kReference:
      break;
  }
  return render_reference(scene, view, traced);
}

ScenePicture render_picture(const PosedGaussians& scene, const SceneView& view) {
  check_scene(scene);
  switch (view.precision) {
    case Precision::kFloat:
      return picture_taped<float>(scene, view);
    case Precision::kDouble:
      return picture_taped<double>(scene, view);
    case Precision::kReference:
      break;
  }
  const SceneImage rendered = render_reference(scene, view, {});
  const std::vector<float> values(rendered.image.begin(), rendered.image.end());
  return {from_interleaved(values, rendered.height, rendered.width, 3), shows_something(rendered), rendered.drawn};
}

SceneGradients scene_gradients(const Gaussians& scene, const SceneView& view, std::span<const double> target) {
  check_sizes(scene);
  HSI4D_CHECK_EQ(target.size(), 3 * pixels_of(view.camera));
  switch (view.precision) {
    case Precision::kFloat:
      return gradients_taped<float>(scene, view, target);
    case Precision::kDouble:
      return gradients_taped<double>(scene, view, target);
    case Precision::kReference:
      break;
  }
  return gradients_reference(scene, view, target);
}

}  // namespace hsi4d
