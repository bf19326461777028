// From posed Gaussians to an image: projection, compositing, background, and what losses ask for beside colour.
#pragma once

#include <utility>
#include <vector>

#include "splat/render/composite.h"

namespace hsi4d {

/// Gaussians in the world, posed; N rows each.
template <class S>
struct SplatInputs {
  Var<S> means;      ///< [N,3] metres, relative to the view's origin
  Var<S> axes;       ///< [N,9] metres (gaussian_axes, transform_axes)
  Var<S> opacities;  ///< [N,1] in [0, 1]
  Var<S> colors;     ///< [N,3]
};

/// What is wanted beside image and transmittance; what is not asked for costs nothing.
struct RenderRequest {
  bool depth = false;
  bool depth_moments = false;
  std::vector<std::pair<Index, Index>> groups = {};  ///< rows [begin, end) whose opacity is wanted, each
};

template <class S>
struct Rendered {
  Var<S> image;            ///< [3,H,W] Σ w c + T background, not clamped
  Var<S> transmittance;    ///< [1,H,W]
  Var<S> depth;            ///< [1,H,W] Σ w z / Σ w, metres, 0 where Σ w = 0; empty unless asked for
  Var<S> depth_moments;    ///< [2,H,W] Σ w z, metres, and Σ w z²; empty unless asked for
  Var<S> group_opacity;    ///< [G,H,W] Σ w over each group; empty unless asked for
  Projected<S> projected;  ///< what was composited, for losses on depths and positions
  std::shared_ptr<const RenderCounters> counters;  ///< of the last forward run
};

/// Renders with the camera Exp(ξ) · view.camera.
///
/// @param xi          [1,6] (translation, rotation) in the camera's frame, see splat/view.h
/// @param background  [1,3] colour behind everything
/// @param intrinsics  none, or [1,4] fx, fy, cx, cy in pixels instead of the view's, see project
/// Adjoint: all inputs; see project and composite for where it stops. The depth has no gradient where Σ w ≤
/// kLeastDepthWeight (row B14). Throws InternalError when the shapes do not fit or a group is out of range.
template <class S>
Rendered<S> render(const SplatInputs<S>& inputs, Var<S> xi, Var<S> background, const SplatView& view,
                   const RenderRequest& request = {}, Var<S> intrinsics = {}, Source where = Source::current());

/// The same for two sets, of which `still` stands still while ξ does: see composite for what is then computed once.
/// Rows of groups are counted through both, those of `still` first. Rendered::projected is that of `moving`.
template <class S>
Rendered<S> render(const SplatInputs<S>& still, const SplatInputs<S>& moving, Var<S> xi, Var<S> background,
                   const SplatView& view, const RenderRequest& request = {}, Var<S> intrinsics = {},
                   Source where = Source::current());

}  // namespace hsi4d
