// The settings of the renderer: config section `render`, and `--set render.KEY=V`.
#pragma once

#include <array>
#include <optional>
#include <span>

#include "core/config.h"
#include "splat/limits.h"

namespace hsi4d {

/// A named trade of accuracy for speed; sets alpha_cap, alpha_min, transmittance_stop and depth_key.
enum class Quality { kFast, kDefault, kAccurate, kReference };

/// Another renderer whose numbers are to be matched.
enum class Compatibility { kNone, kGsplat, kInria };

/// Whether the Gaussian that takes the transmittance past the threshold is still added.
enum class StopRule { kInclusive, kExclusive };

/// Which transmittance counts as past the threshold.
enum class StopWhen { kBelow, kAtOrBelow };

/// What flows back to opacity and shape where the cap holds alpha.
enum class CapGradient { kZero, kPass };

/// Which pixels a Gaussian may touch.
enum class Footprint { kExact, kSquare3Sigma };

/// The type in which depths are compared.
enum class DepthKey { kFloat, kDouble };

inline constexpr std::array<ConfigChoice<Quality>, 4> kQualities = {{{Quality::kFast, "fast"},
                                                                     {Quality::kDefault, "default"},
                                                                     {Quality::kAccurate, "accurate"},
                                                                     {Quality::kReference, "reference"}}};
inline constexpr std::array<ConfigChoice<Compatibility>, 3> kCompatibilities = {
    {{Compatibility::kNone, "none"}, {Compatibility::kGsplat, "gsplat"}, {Compatibility::kInria, "inria"}}};
inline constexpr std::array<ConfigChoice<StopRule>, 2> kStopRules = {
    {{StopRule::kInclusive, "inclusive"}, {StopRule::kExclusive, "exclusive"}}};
inline constexpr std::array<ConfigChoice<StopWhen>, 2> kStopWhens = {
    {{StopWhen::kBelow, "below"}, {StopWhen::kAtOrBelow, "at_or_below"}}};
inline constexpr std::array<ConfigChoice<CapGradient>, 2> kCapGradients = {
    {{CapGradient::kZero, "zero"}, {CapGradient::kPass, "pass"}}};
inline constexpr std::array<ConfigChoice<Footprint>, 2> kFootprints = {
    {{Footprint::kExact, "exact"}, {Footprint::kSquare3Sigma, "square_3sigma"}}};
inline constexpr std::array<ConfigChoice<DepthKey>, 2> kDepthKeys = {
    {{DepthKey::kFloat, "float"}, {DepthKey::kDouble, "double"}}};

/// How Gaussians become pixels. α = min(alpha_cap, o·G); α < alpha_min is skipped; T ← T(1 − α).
struct RenderSettings {
  Quality quality = Quality::kDefault;
  Compatibility compatibility = Compatibility::kNone;
  double alpha_cap = kAlphaCap;
  double alpha_min = kAlphaMin;                    ///< 0: no Gaussian is cut
  double transmittance_stop = kTransmittanceStop;  ///< 0: every Gaussian is composited
  StopRule stop_rule = StopRule::kInclusive;
  StopWhen stop_when = StopWhen::kBelow;
  CapGradient cap_gradient = CapGradient::kZero;
  Footprint footprint = Footprint::kExact;
  double blur = kBlur;     ///< pixels²
  bool antialias = false;  ///< opacity compensated for what the blur adds
  double near = kNear;     ///< metres
  double frustum_clamp = kFrustumClamp;
  int sh_degree = kHighestShDegree;
  std::optional<DepthKey> depth_key;  ///< none: float32 in a float render, float64 otherwise
  int tile = kTile;                   ///< pixels
};

/// What is not computed because the result does not need it: config section `skip`. The image is the same within 1e-6,
/// the gradients within 1e-5.
struct RenderSkips {
  /// Gaussians that stand still are prepared once, and blocks of pixels that nothing touches which moves are not
  /// composited again. The same bits.
  bool static_tiles = true;
  /// Of Gaussians that stand still, those in front of all that moves in a tile are composited once, and the adjoint
  /// visits neither these nor those behind. Needs static_tiles.
  bool static_layer = true;
  /// The adjoint leaves out tiles whose cotangent is zero, as where a mask makes a loss blind.
  bool zero_cotangent = true;
  /// Losses over pixels look again at those that were written, and give gradients to those that the adjoint reads. The
  /// same bits.
  bool unchanged_pixels = true;
  /// Gaussians of the scene that the camera cannot see, however far a stage may move it, are left out of its tape. The
  /// same image; sums over Gaussians are rounded otherwise.
  bool unseen_gaussians = true;
};

/// Sets what the quality names: `fast` stops earlier; `accurate` has no cap, alpha_min 2e-6 and stop 1e-7; `reference`
/// has no cap, no cut, no stop and sorts in double.
void apply_quality(RenderSettings& settings, Quality quality);

/// Sets what makes the numbers of another renderer. `gsplat`: cap 0.99, alpha_min 1/255, exclusive stop at T(1−α) ≤
/// 1e-4, blur 0.3, near 0.01, clamp 1.3, zero gradient where the cap holds. `inria`: the same with near 0.2, stop at <
/// 1e-4, its square support of 3σ, and the gradient passed through the cap.
void apply_compatibility(RenderSettings& settings, Compatibility compatibility);

/// Describes the section `skip`.
void describe(ConfigFields& fields, RenderSkips& skip);

/// Describes every setting. A preset is applied before the other keys are read, so an explicitly written key wins.
void describe(ConfigFields& fields, RenderSettings& settings);

}  // namespace hsi4d
