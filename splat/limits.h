// The only home of the renderer's thresholds: alpha, blur and stop constants. Everything else reads RenderSettings,
// whose defaults and presets are made of these.
#pragma once

#include <cstdint>

namespace hsi4d {

/// Alpha is held at or below this. 1 − 2⁻¹² leaks less than a sixteenth of an 8-bit step through an opaque Gaussian,
/// (stability B16).
inline constexpr double kAlphaCap = 1.0 - 1.0 / 4096;
/// No cap: for a backward pass that does not divide, as ours.
inline constexpr double kNoAlphaCap = 1.0;
inline constexpr double kAlphaCapCompatible = 0.99;

/// A Gaussian fainter than this at a pixel is skipped there: one 8-bit step (stability B5).
inline constexpr double kAlphaMin = 1.0 / 255;
inline constexpr double kAlphaMinAccurate = 2e-6;

/// Compositing of a pixel ends when the transmittance falls below this (stability B4).
inline constexpr double kTransmittanceStop = 1e-3;
inline constexpr double kTransmittanceStopFast = 1e-2;
inline constexpr double kTransmittanceStopCompatible = 1e-4;
inline constexpr double kTransmittanceStopAccurate = 1e-7;

/// No gradient flows through a normalised depth where Σ w is at or below this: 1/Σ w, on its way back through the
/// compositor, has to stay far from float's largest number (stability B14).
inline constexpr double kLeastDepthWeight = 1e-8;

/// Variance of the low-pass filter added to every projected covariance, pixels².
inline constexpr double kBlur = 0.3;

/// Gaussians at or nearer than this camera z are culled, metres.
inline constexpr double kNear = 0.01;
inline constexpr double kNearInria = 0.2;

/// x/z and y/z of the projection's Jacobian are held within this many half-widths of the view.
inline constexpr double kFrustumClamp = 1.3;

/// Opacity logits of files are held within ± this: beyond, the sigmoid and its slope are lost (stability B15).
inline constexpr double kOpacityLogitLimit = 20;

/// Highest degree of the spherical harmonics.
inline constexpr int kHighestShDegree = 3;

/// Opacities are held at this in logarithms.
inline constexpr double kLeastOpacity = 1e-30;
/// No alpha below float's least normal number is composited in float, whatever alpha_min is (stability B5).
inline constexpr float kLeastAlpha = 0x1p-126f;

/// In float, settings below these take the more exact form of the pixel loops: u and w from the block's centre, and an
/// exponential to half a unit in the last place. Above, cuts are larger errors than what that form saves, also those of
/// `accurate` (docs/numerics/pareto.md#the-careful-arithmetic).
inline constexpr float kExactBelowAlpha = 1e-6f;
inline constexpr float kExactBelowStop = 1e-7f;
inline constexpr float kExactBelowBlur = 0.1f;

/// Side of a square tile, pixels.
inline constexpr int kTile = 16;

/// Log-scales are held within ± this, so that a scale is a finite number of metres (stability A5).
inline constexpr double kLogScaleLimit = 20;

/// Most (tile, Gaussian) pairs of an image, so that list positions fit 32 bits with a sign; more are refused before
/// memory is taken for them (stability B10).
inline constexpr std::int64_t kMostPairs = (std::int64_t(1) << 31) - 1;
/// Share of the machine's memory that the pairs of an image may take; more is refused likewise.
inline constexpr double kPairMemoryShare = 0.75;

}  // namespace hsi4d
