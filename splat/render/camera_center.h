// Where a moved camera stands.
#pragma once

#include "splat/view.h"

namespace hsi4d {

/// The centre of the camera Exp(ξ) · view.camera (splat/view.h), relative to view.origin_world.
///
/// @param xi  [1,6]
/// @return    [1,3] metres
/// Adjoint: xi. Throws InternalError for another shape.
template <class S>
Var<S> camera_center(Var<S> xi, const SplatView& view, Source where = Source::current());

}  // namespace hsi4d
