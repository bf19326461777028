// Skinning weights of the procedural body.
#pragma once

#include <vector>

#include "body/procedural_shape.h"
#include "body/skinning.h"
#include "body/surface_nets.h"

namespace hsi4d::detail {

/// Weights of the vertices of a mesh of body_field (frame of procedural_shape.h), 4 a vertex, normalised.
///
/// Each limb's weights follow from where a point is along it, so that only neighbouring bones blend; then they are
/// averaged along the surface, never through space.
SparseWeights procedural_weights(const NetMesh& mesh);

}  // namespace hsi4d::detail
