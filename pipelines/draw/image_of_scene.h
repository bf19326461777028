// One image of Gaussians, and the gradients of its difference from another image, in any of the three precisions.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "core/camera.h"
#include "core/image.h"
#include "splat/gaussians.h"
#include "splat/reference/debug_pixel.h"
#include "splat/render_settings.h"

namespace hsi4d {

/// The taped renderer in float or double, or the brute-force one in double (splat/reference/reference.h).
enum class Precision { kFloat, kDouble, kReference };

inline constexpr std::array<ConfigChoice<Precision>, 3> kPrecisions = {
    {{Precision::kFloat, "float"}, {Precision::kDouble, "double"}, {Precision::kReference, "reference"}}};

/// Gaussians, and how each was moved from where its numbers put it.
struct PosedGaussians {
  Gaussians gaussians;
  /// Empty, or [N,12]: rows [3,4], applied to axes and to means in the world (origin_world added); not to SH
  /// directions.
  std::vector<double> transforms;
};

/// From where, onto what, and how.
struct SceneView {
  Camera camera;
  std::array<double, 3> background = {0, 0, 0};
  RenderSettings settings;
  Precision precision = Precision::kFloat;
};

/// An image, interleaved; numbers are floats where the precision is float.
struct SceneImage {
  int width = 0, height = 0;            ///< pixels
  std::vector<double> image;            ///< [H,W,3] Σ w c + T background, not clamped
  std::vector<double> alpha;            ///< [H,W] 1 − T
  std::vector<double> depth;            ///< [H,W] Σ w z / Σ w, metres; 0 where Σ w = 0
  std::optional<Index> drawn = {};      ///< Gaussians that reach the image; brute force does not count them
  std::vector<PixelTrace> traces = {};  ///< of the pixels asked for
};

/// An image alone, as image files hold it.
struct ScenePicture {
  Image image;                      ///< [3,H,W] Σ w c + T background, not clamped
  bool shows_something = false;     ///< alpha is above 0 somewhere
  std::optional<Index> drawn = {};  ///< as in SceneImage
};

/// A loss and its derivatives, shaped like the numbers of the Gaussians.
struct SceneGradients {
  double loss = 0;                     ///< mean over H·W·3 of (image − target)²
  SceneImage rendered;                 ///< without depth
  std::vector<double> means;           ///< [N,3]
  std::vector<double> quats;           ///< [N,4] of the raw quaternions
  std::vector<double> log_scales;      ///< [N,3]
  std::vector<double> opacity_logits;  ///< [N]
  std::vector<double> sh;              ///< [N,K,3]; zero above the degree that is used
  std::array<double, 6> camera{};  ///< at ξ = 0 of T ← Exp(ξ) T, ξ = (translation, rotation), T = camera_from_world
};

/// Whether alpha is above 0 somewhere.
bool shows_something(const SceneImage& rendered);

/// Renders, and tells what made the pixels `traced`. Throws InternalError as check_sizes, for transforms of another
/// count, or for a pixel that is not in the image.
SceneImage render_scene(const PosedGaussians& scene, const SceneView& view, std::span<const PixelPlace> traced = {});

/// Renders the image of render_scene, rounded to float, in half the time and memory: depth is not composited.
ScenePicture render_picture(const PosedGaussians& scene, const SceneView& view);

/// Renders and differentiates.
/// @param target  [H,W,3]. Throws InternalError for another count of numbers.
SceneGradients scene_gradients(const Gaussians& scene, const SceneView& view, std::span<const double> target);

}  // namespace hsi4d
