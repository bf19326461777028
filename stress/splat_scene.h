// Gaussians and a camera for rows about images, and what the renderer makes of them: values, and the gradients of a
// loss with random weights.
#pragma once

#include <array>
#include <vector>

#include "core/camera.h"
#include "splat/gaussians.h"
#include "splat/reference/reference.h"
#include "splat/render/render.h"
#include "stress/front_view.h"

namespace hsi4d::stress {

struct Scene {
  Gaussians gaussians;
  Camera camera;
  RenderSettings settings;
  std::array<float, 3> background = {0.25F, 0.5F, 0.75F};

  /// A Gaussian of one colour, axes along the world's. Scales in metres.
  void add(const Vector3<double>& mean, const Vector3<double>& scales, double opacity_logit,
           const std::array<double, 3>& color);
};

/// A camera in general position that looks at the origin from about 4 m away.
Camera tilted_camera(int width, int height);

/// No Gaussian at all.
Scene empty_scene(const Camera& camera);
/// Gaussians of all shapes in a ball that fills the tilted camera's view; degree 3. Every number is a float.
Scene random_scene(Index n, std::uint64_t seed, int width, int height);

/// Gaussians all over the front camera's image, 2 to 5 m away, from 2 to 10 pixels wide; degree 1.
Scene small_scene(Index n, int width, int height, std::uint64_t seed);

/// The scene and its camera, `factor` times as large.
Scene scaled(Scene scene, double factor);
/// The scene and its camera moved: by the origin of its means.
Scene translated(Scene scene, const Vector3<double>& offset);
/// The same Gaussians with the world's origin as theirs: what is lost in float is lost.
Scene in_world(Scene scene);

/// A scene on a tape.
template <class S>
struct TapedScene {
  Tape<S> tape;
  SplatView view;
  Var<S> means, quats, log_scales, opacity_logits, sh, xi, background;
  Var<S> axes, opacities, colors;
  Rendered<S> rendered;
  Var<S> loss;  ///< Σ of image and transmittance, times weights in [−1, 1]

  /// @param axes  [N,9] metres, instead of those of quaternions and log-scales; empty: these
  explicit TapedScene(const Scene& scene, const std::vector<double>& axes = {}, const RenderRequest& request = {});

  /// Forward and backward.
  void run();
  std::vector<double> value(Var<S> of) const;
  std::vector<double> gradient(Var<S> of) const;
  std::vector<Var<S>> leaves() const { return {means, quats, log_scales, opacity_logits, sh, xi, background}; }
};

/// What becomes of a scene, in double.
struct Rendering {
  std::vector<double> image, transmittance;                                  ///< [3,H,W], [H,W]
  std::vector<double> means, quats, log_scales, opacity_logits, sh, camera;  ///< gradients of the loss

  /// All gradients, one after the other.
  std::vector<double> gradients() const;
};

template <class S>
Rendering render_scene(const Scene& scene, const std::vector<double>& axes = {});

/// The image of a scene, in double.
std::vector<double> exact_image(const Scene& scene);

/// The largest difference of the image of `part` and the window of the image of `whole` at (left, top), in float.
double crop_difference(const Scene& whole, const Scene& part, int left, int top);

/// The image and T of the brute-force renderer, laid out as in Rendering; without gradients.
Rendering reference_rendering(const Scene& scene);

/// The scene as the brute-force renderer takes it. The origin is the world's.
reference::Scene<double> reference_scene(const Scene& scene);
reference::Pinhole<double> reference_pinhole(const Camera& camera);

}  // namespace hsi4d::stress
