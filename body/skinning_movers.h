// How skinned points follow their joints, for a curvature (autodiff/curvature.h). Not a public header.
#pragma once

#include "autodiff/twists.h"
#include "body/skinning_kernel.h"

namespace hsi4d::detail {

/// Every joint that has points becomes a mover, about the mean of where it places them:
///
///   d y_v = Σ_j w_vj (v_j + ω_j × (A_j x_v − o_j))
///
/// @param io  of an operator whose inputs begin with transforms [J,12] and points [V,3], its outputs with the points
template <class S>
void push_joints(NodeIo<S>& io, const SparseTable<S>& table, Movers<S>& movers);

}  // namespace hsi4d::detail
