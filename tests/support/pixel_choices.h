// What the compositor decides at each pixel: which Gaussians it composites, which of them the cap holds, where it
// stops. Rebuilt from what was projected, pixel by pixel, with the functions that the compositor is made of.
//
// Two renders whose choices at a pixel are equal are there the same smooth function of the Gaussians' numbers; where
// they differ the pixel flips a cut, and its colour and gradients may jump.
#pragma once

#include <cstdint>
#include <vector>

#include "splat/render/composite.h"

namespace hsi4d::test {

struct PixelChoices {
  /// [H·W], of the rows of the Gaussians that are composited, in order, each with whether the cap holds it, and of the
  /// one at which the pixel stops.
  std::vector<std::uint64_t> hashes;
  Index fragments = 0;  ///< as RenderCounters has them
  Index skipped = 0;    ///< (pixel, Gaussian), in tiles that it reaches, where α is below alpha_min
  Index capped = 0;     ///< fragments that the cap holds
  Index stopped = 0;    ///< pixels that stop before their last Gaussian or at it
};

/// The choices of composite(projected, opacities, …, view) for the values that the tape holds now. Features that are
/// not finite are not looked for.
template <class S>
PixelChoices pixel_choices(const Tape<S>& tape, const Projected<S>& projected, Var<S> opacities, const SplatView& view);

/// Pixels [row · width + column] whose choices differ.
std::vector<std::size_t> flipped_pixels(const PixelChoices& a, const PixelChoices& b);

}  // namespace hsi4d::test
