// Gaussians that take each other's places: how many show what one showed [Kheradmand et al. 2024, 3D Gaussian splatting
// as Markov chain Monte Carlo].
#pragma once

#include "core/types.h"

namespace hsi4d {

/// What each of several equal Gaussians at one place has in place of one.
struct SharedShape {
  double opacity = 0;
  double scale = 1;  ///< factor of the three scales
};

/// With more the formula is taken for so many: their opacities hardly change any more.
inline constexpr Index kMostCopies = 51;
/// The opacity above which a Gaussian is taken for this opaque: of 1 all copies would be 1.
inline constexpr double kMostSharedOpacity = 1 - 1e-6;

/// N copies with opacity o' and scales times f that composite to what one with opacity o does: at the centre exactly,
/// and in the integral along any line through it.
///
///   o' = 1 − (1 − o)^(1/N),   f = o / Σ_{i=1}^{N} Σ_{k=0}^{i−1} C(i−1, k) (−1)ᵏ o'ᵏ⁺¹/√(k+1)    [eq. 9]
///
/// @param opacity  o in [0, 1], held at kMostSharedOpacity
/// @param copies   N, 1 to kMostCopies
/// Adjoint: none, a change of parameters between steps. Throws InternalError out of these ranges.
SharedShape shared_shape(double opacity, Index copies);

}  // namespace hsi4d
