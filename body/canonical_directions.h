// The direction from which a camera sees each point of a posed body, in the axes of the rest pose.
//
//   w_n = L_nᵀ (p_n − c),   v_n = w_n/|w_n|
//
// L is the linear part of the point's blended transform, c the camera's centre. Where L is a rotation, v is the world's
// direction turned back with the body; where blending has made it something else no inverse is needed, and v stays
// finite also where L is singular (row D2: singular blend).
#pragma once

#include "autodiff/tape.h"

namespace hsi4d {

/// @param transforms  [N,12], rows [3,4] of posed_from_rest
/// @param points      [N,3] metres, posed, world
/// @param center      [1,3] metres, world: the camera's centre
/// @return            [N,3] of length 1; (0, 0, 1) where w is zero or not finite
/// Adjoint: transforms (their linear parts), points, center; none for a point where w cannot be normalised.
/// Throws InternalError when the shapes do not fit.
template <class S>
Var<S> canonical_directions(Var<S> transforms, Var<S> points, Var<S> center, Source where = Source::current());

}  // namespace hsi4d
