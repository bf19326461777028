// Scenes for tests of the renderer, by what is hard about them. The same arguments give the same numbers everywhere,
// and every number of a Gaussian is a float, so that renders in float, double and long double start from equal inputs.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "core/camera.h"
#include "splat/gaussians.h"
#include "splat/reference/reference.h"
#include "splat/render_settings.h"

namespace hsi4d::test {

/// Gaussians, and the view of them. Members are named and laid out as in hsi4d::Gaussians.
struct SplatScene {
  std::string name;
  int sh_degree = 0;
  std::vector<float> means;           ///< [N,3] metres
  std::vector<float> quats;           ///< [N,4] wxyz, raw
  std::vector<float> log_scales;      ///< [N,3]
  std::vector<float> opacity_logits;  ///< [N]
  std::vector<float> sh;              ///< [N,K,3], K = (sh_degree+1)²
  Camera camera;
  RenderSettings settings;
  std::array<float, 3> background = {0, 0, 0};

  Index count() const { return static_cast<Index>(opacity_logits.size()); }
  int sh_coefficients() const { return (sh_degree + 1) * (sh_degree + 1); }
  Gaussians gaussians() const;
  /// Adds a Gaussian whose other numbers are as given and whose colour is the same from everywhere.
  void add(const std::array<double, 3>& mean, double scale, double opacity_logit, const std::array<double, 3>& color);
};

struct SceneSize {
  int width = 40;
  int height = 30;
};

/// A camera at the origin with the world's axes as its own: p_camera = p_world, exactly. Focal length = width.
Camera plain_camera(const SceneSize& size);
/// A camera in general position that looks at the origin from about 4 m away.
Camera tilted_camera(const SceneSize& size);

/// n Gaussians of all shapes in a ball that fills the tilted camera's view; degree 3, colours mostly inside (0, 1).
SplatScene random_splats(Index n, std::uint64_t seed, const SceneSize& size = {});
/// Needles: the longest axis is `aspect` times the two others, any direction, about a third of the image long.
SplatScene needles(Index n, double aspect, std::uint64_t seed, const SceneSize& size = {});
/// Opacity logits from −40 to 40, with 15, 17, 20, the logit of 1 − 1e-7 and of the default cap among them.
SplatScene saturated(std::uint64_t seed, const SceneSize& size = {});
/// Gaussians in front of, behind, beside, above and below the camera, beside it also beyond the frustum clamp, large
/// enough to reach into the image.
SplatScene behind_and_beside(std::uint64_t seed, const SceneSize& size = {});
/// Depths at and around `near` (0.999 to 4 times), small Gaussians, and large ones that reach over the near plane.
SplatScene near_plane(std::uint64_t seed, const SceneSize& size = {});
/// As random_splats, with quaternions of length 1e-6 to 1e6.
SplatScene raw_quaternions(Index n, std::uint64_t seed, const SceneSize& size = {});
/// As random_splats, with fx ≠ fy and the principal point at (0.8 W, 0.1 H).
SplatScene off_centre(Index n, std::uint64_t seed, const SceneSize& size = {});
/// Layers of overlapping Gaussians whose depths are exactly equal within a layer, in shuffled order; plain camera.
SplatScene depth_ties(std::uint64_t seed, const SceneSize& size = {});
/// n Gaussians one behind the other on the ray of the central pixel's centre, of α there about `alpha` each (before the
/// cap), in shuffled order, colours different; plain camera.
SplatScene stack(Index n, double alpha, std::uint64_t seed, const SceneSize& size = {});
/// n faint Gaussians of about a pixel all over the image, at depths 2 to 4; plain camera. In an image of 20 × 20 pixels
/// two thirds of them reach the first tile.
SplatScene crowded(Index n, std::uint64_t seed, const SceneSize& size = {20, 20});
/// Log-scales 0, ±20, ±40, ±88, ±200, ±inf, NaN, means and quaternions that are not finite, zero quaternions, among
/// good Gaussians.
SplatScene broken_numbers(std::uint64_t seed, const SceneSize& size = {});

/// One of each kind above but broken_numbers, small enough for the brute-force renderer in long double.
std::vector<SplatScene> all_scenes(std::uint64_t seed);

template <class T>
reference::Scene<T> reference_scene(const SplatScene& scene);
template <class T>
reference::Pinhole<T> reference_pinhole(const Camera& camera);
template <class T>
std::array<T, 3> reference_background(const SplatScene& scene) {
  return {T(scene.background[0]), T(scene.background[1]), T(scene.background[2])};
}

}  // namespace hsi4d::test
