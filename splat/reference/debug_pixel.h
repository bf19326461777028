// What makes up a pixel: the Gaussians composited there, front to back. `hsi4d render --debug-pixel X,Y` prints it.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "splat/render/composite.h"

namespace hsi4d {

/// A pixel of an image.
struct PixelPlace {
  int column = 0, row = 0;
};

/// A Gaussian at a pixel.
struct PixelSplat {
  Index index = 0;                 ///< row of the inputs
  double depth = 0;                ///< camera z, metres
  double full = 0;                 ///< o G, α before the cap
  double alpha = 0;                ///< after it
  bool capped = false;             ///< the cap holds α
  double transmittance = 1;        ///< T in front of it
  std::array<double, 3> color{};   ///< c
  std::array<double, 3> so_far{};  ///< Σ w c up to it, with it

  double weight() const { return transmittance * alpha; }
};

/// What was composited at a pixel, and what was not.
struct PixelTrace {
  PixelPlace place;
  std::vector<PixelSplat> composited;      ///< front to back
  Index skipped = 0;                       ///< looked at before the stop, α < alpha_min
  std::optional<PixelSplat> nearest_miss;  ///< of these, the one of largest α
  bool stopped = false;                    ///< T went past transmittance_stop; the Gaussian that took it there is
  std::optional<PixelSplat> refused;       ///< this one, not added (stop_rule exclusive), or else the last composited
  Index behind_stop = 0;                   ///< Gaussians behind it, not looked at
  double transmittance = 1;                ///< T behind the last one
  double depth_sum = 0;                    ///< Σ w z, metres

  /// Σ w c.
  std::array<double, 3> color() const {
    return composited.empty() ? std::array<double, 3>{} : composited.back().so_far;
  }
  double weight_sum() const;

  /// Adds a Gaussian behind those that are there: its so_far, the sums.
  void add(PixelSplat splat);
  /// Counts one that is not composited because its α is below alpha_min.
  void skip(const PixelSplat& splat);
};

/// What composite(projected, opacities, features, view) does at a pixel, for the values that the tape holds now: α, T
/// and the choices by the functions of the kernel in use, sums and `full` in double. Gaussians that do not reach the
/// pixel's tile are not looked at.
///
/// @param features  [N,C] as composite has them; the first three are colours
/// Throws InternalError when the pixel is not in the image or C < 3.
template <class S>
PixelTrace trace_pixel(const Tape<S>& tape, const Projected<S>& projected, Var<S> opacities, Var<S> features,
                       const SplatView& view, PixelPlace place);

/// trace_pixel of several pixels: the Gaussians are prepared once.
template <class S>
std::vector<PixelTrace> trace_pixels(const Tape<S>& tape, const Projected<S>& projected, Var<S> opacities,
                                     Var<S> features, const SplatView& view, std::span<const PixelPlace> places);

}  // namespace hsi4d
