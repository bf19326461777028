// Which Gaussians a camera may see that moves no further than it is known to.
#pragma once

#include <vector>

#include "splat/gaussians.h"
#include "splat/view.h"

namespace hsi4d {

/// How far Exp(ξ) may take a camera: a point p in its frame moves by at most rotation·|p| + translation.
struct CameraReach {
  double translation = 0;  ///< |ρ| at most, metres
  double rotation = 0;     ///< |φ| at most, radians
};

/// The rows, ascending, that may touch a pixel of the view from some camera within reach. Rows that are not named are
/// not drawn from any of them; some that are named may not be either: a Gaussian counts as a ball, in intervals of its
/// place. All rows where alpha is not cut (alpha_min 0), as a Gaussian then reaches every pixel.
std::vector<Index> reachable_rows(const Gaussians& gaussians, const SplatView& view, const CameraReach& reach);

}  // namespace hsi4d
