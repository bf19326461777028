// Which Gaussian a pixel shows at its median depth: the one at which less than half of the light is left.
#pragma once

#include <cstdint>
#include <vector>

#include "splat/render/project.h"

namespace hsi4d {

/// The first Gaussian of each pixel, front to back, behind which T ≤ ½, by the values that the tape holds now.
///
///   row = min { i : T_{i+1} ≤ ½ },   −1 where T stays above ½     (T as in composite.h, by the kernel in use)
///
/// @param projected, opacities  of N Gaussians, computed
/// @return  [H,W]
/// Throws as composite.
template <class S>
std::vector<std::int32_t> median_rows(const Tape<S>& tape, const Projected<S>& projected, Var<S> opacities,
                                      const SplatView& view);

}  // namespace hsi4d
