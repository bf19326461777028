#include "pipelines/draw/image_of_scene.h"

#include <algorithm>

#include "core/check.h"
#include "core/parallel.h"
#include "pipelines/draw/image_cotangent.h"
#include "pipelines/draw/reference_render.h"
#include "pipelines/draw/taped_scene.h"

namespace hsi4d {
namespace {

std::size_t pixels_of(const Camera& camera) {
  return static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
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
  result.traces = scene.traces(traced);
  return result;
}

/// Σ over the pixels of T · cotangent.
std::array<double, 3> background_gradient(std::span<const double> transmittance, std::span<const double> cotangent) {
  std::array<double, 3> gradient{};
  std::vector<double> terms(transmittance.size());
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::size_t i = 0; i < terms.size(); ++i) terms[i] = transmittance[i] * cotangent[3 * i + c];
    gradient[c] = pairwise_sum(terms.data(), static_cast<Index>(terms.size()));
  }
  return gradient;
}

template <class S>
ImageAdjoint adjoint_taped(const Gaussians& gaussians, const SceneView& view, const CotangentOf& cotangent_of) {
  TapedScene<S> scene({gaussians, {}}, view, false);
  scene.tape.forward(scene.rendered.transmittance);
  scene.tape.forward(scene.rendered.image);
  ImageAdjoint result;
  result.numbers.rendered = image_of(scene, view.camera);
  const std::vector<double> cotangent = cotangent_of(result.numbers);
  scene.tape.backward(scene.rendered.image, planar<S>(cotangent));
  scene.copy_gradients(result.numbers);
  result.background = background_gradient(interleaved(scene.tape.value(scene.rendered.transmittance)), cotangent);
  return result;
}

ImageAdjoint adjoint_by_reference(const Gaussians& gaussians, const SceneView& view, const CotangentOf& cotangent_of) {
  ImageAdjoint result;
  std::vector<double> cotangent;
  result.numbers = adjoint_reference(gaussians, view, [&](SceneGradients& gradients) {
    cotangent = cotangent_of(gradients);
    return cotangent;
  });
  std::vector<double> transmittance = result.numbers.rendered.alpha;
  for (double& t : transmittance) t = 1 - t;
  result.background = background_gradient(transmittance, cotangent);
  return result;
}

ImageAdjoint adjoint_of(const Gaussians& gaussians, const SceneView& view, const CotangentOf& cotangent_of) {
  switch (view.precision) {
    case Precision::kFloat:
      return adjoint_taped<float>(gaussians, view, cotangent_of);
    case Precision::kDouble:
      return adjoint_taped<double>(gaussians, view, cotangent_of);
    case Precision::kReference:
      break;
  }
  return adjoint_by_reference(gaussians, view, cotangent_of);
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
  return adjoint_of(scene, view,
                    [target](SceneGradients& result) {
                      std::vector<double> cotangent;
                      result.loss = squared_loss(result.rendered.image, target, cotangent);
                      return cotangent;
                    })
      .numbers;
}

ImageAdjoint image_adjoint(const Gaussians& gaussians, const SceneView& view, std::span<const double> cotangent) {
  check_sizes(gaussians);
  HSI4D_CHECK_EQ(cotangent.size(), 3 * pixels_of(view.camera));
  return adjoint_of(gaussians, view, [cotangent](SceneGradients& result) {
    std::vector<double> products(cotangent.size());
    for (std::size_t i = 0; i < products.size(); ++i) products[i] = cotangent[i] * result.rendered.image[i];
    result.loss = pairwise_sum(products.data(), static_cast<Index>(products.size()));
    return std::vector<double>(cotangent.begin(), cotangent.end());
  });
}

}  // namespace hsi4d
