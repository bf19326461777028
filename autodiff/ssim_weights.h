// The weights that a structural difference gives the pixels of an image in a curvature (autodiff/curvature.h).
//
// Of 1 − ssim at u the part that counts is D = V_d/Q (autodiff/ssim.h), quadratic in the differences d with Q, the
// contrast of both images, taken as given:
//
//   V_d = Σ_p w(p−u) d_p² − m_d² ≤ Σ_p w(p−u) d_p²,   so that   ∂²/∂d_p² ≤ 2 Σ_u w(p−u)/Q_u
//
// without the products of pixels. That is a bound from above: along motions that change the pixels of a window alike,
// the difference of structure hardly changes.
#pragma once

#include "autodiff/array.h"
#include "autodiff/tile_mask.h"

namespace hsi4d::detail {

/// to += scale · 2 Σ_u w(p−u)/Q_u in some squares of pixels.
///
/// @param image, target  [C,H,W]
/// @param squares        null: all
/// @param to             [C,H,W]
template <class S>
void add_ssim_weights(const ConstArray<S>& image, const ConstArray<S>& target, const TileMask* squares,
                      double data_range, S scale, const Array<S>& to);

}  // namespace hsi4d::detail
