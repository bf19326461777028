// Compositing of projected Gaussians, front to back, and its adjoint without a division.
//
//   α_i = min(cap, o_i G_i),  G = exp(−½ dᵀ (V Vᵀ + blur I)⁻¹ d),   w_i = T_i α_i,  T_{i+1} = T_i (1 − α_i),  T_1 = 1
//   channels = Σ w_i f_i
//
// at each pixel centre, d from the mean. α < alpha_min is skipped. With antialias o_i is the opacity times
// sqrt(det V Vᵀ / det(V Vᵀ + blur I)). Gaussians are sorted once by (depth, index); every tile visits those that can
// reach it. The adjoint uses what is seen behind each Gaussian (rows B1, B2; M19),
//
//   d_α_i = T_i (g·f_i − S_i),   S_{i−1} = α_i g·f_i + (1 − α_i) S_i,   S_n = d_T,
//
// with g the gradient of the pixel's channels, never dividing by 1 − α.
#pragma once

#include <memory>

#include "splat/render/project.h"
#include "splat/render/render_counters.h"

namespace hsi4d {

/// Gaussians in the image and what is composited of them.
template <class S>
struct SplatSet {
  Projected<S> projected;  ///< see project
  Var<S> opacities;        ///< [N,1] in [0, 1]
  Var<S> features;         ///< [N,C] what is composited: colours, depths, …; C ≥ 1
};

template <class S>
struct Composited {
  Var<S> channels;       ///< [C,H,W] Σ w f; with a background of B numbers [B,H,W] Σ w f + T background
  Var<S> transmittance;  ///< [1,H,W] T behind the last Gaussian
  Var<S>
      more_channels;  ///< [C−B,H,W] Σ w f of the other features, with a background; else, and if there are none, empty
  std::shared_ptr<const RenderCounters> counters;  ///< of the last forward run
};

/// Composites Gaussians into an image of view.camera's size. Not drawn are: rows whose factors are six zeros, depths ≤
/// near, rows with a number that is not finite, and, with blur 0, Gaussians without area (rows A4-A6: not drawable).
///
/// @param background  none, or [1,B], 1 ≤ B ≤ C: what lies behind everything in the first channels
/// @return            image-shaped arrays
/// Adjoint: projected.means_px and means_low (of whose sum it is), projected.factors, opacities, features, background;
/// each computed only when wanted. None where o G > alpha_cap (unless cap_gradient is pass), none through the order,
/// the choice of pixels and the stop. A Gaussian that is not drawn has gradient 0. Throws InternalError when the shapes
/// do not fit; UserError when there are more than kMostPairs (tile, Gaussian) pairs, or when they would take more than
/// kPairMemoryShare of the memory.
template <class S>
Composited<S> composite(const SplatSet<S>& splats, const SplatView& view, Var<S> background = {},
                        Source where = Source::current());

/// The same for the rows of two sets, `still` in front in the order of rows. While no gradient is wanted in `still`,
/// its records, order and lists are kept until one of its inputs changes, and only what `moving` touches is composited
/// anew: see RenderSkips, which says what that changes, and splat/render/static_layer.h. With a gradient, or without
/// static_tiles, the result is that of one set. A background that changes is laid behind everything anew.
///
/// Adjoint: as above, of both sets.
template <class S>
Composited<S> composite(const SplatSet<S>& still, const SplatSet<S>& moving, const SplatView& view,
                        Var<S> background = {}, Source where = Source::current());

}  // namespace hsi4d
