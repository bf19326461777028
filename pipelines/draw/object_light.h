// Light on rigid objects beside that which the colours of their Gaussians have: an object that turns, or comes into the
// shade, is brighter or darker in the video than its file says. Low-order: a factor a channel, and one by the direction
// of the surface.
#pragma once

#include "autodiff/tape.h"
#include "splat/gaussians.h"

namespace hsi4d {

/// [N,3] unit normals of Gaussians, in their own frame: of each the shortest axis, pointing away from the origin. A
/// constant.
template <class S>
Var<S> outward_normals(Tape<S>& tape, const Gaussians& gaussians);

/// colors · exp(f + n·l).
/// @param colors   [N,3]
/// @param normals  [N,3] outward_normals
/// @param turn     [1,9] rows of world_from_object's rotation
/// @param light    [1,6] f and l, as ObjectLight (pipelines/input/state.h)
/// Adjoint: colors, turn, light.
template <class S>
Var<S> lit_colors(Var<S> colors, Var<S> normals, Var<S> turn, Var<S> light);

}  // namespace hsi4d
