// How the triangles of a mesh hang together.
#pragma once

#include <vector>

#include "optim/solid/mesh_file.h"

namespace hsi4d {

/// Triangles that hang together by their corners, each part with its own vertices.
std::vector<TriangleMesh> connected_parts(const TriangleMesh& mesh);

/// The volume that a closed surface holds, m³; negative where it is turned inwards.
double signed_volume(const TriangleMesh& mesh);

/// Vertices around which the triangles are not one fan that closes, each neighbour once on either side, ascending.
/// None: the surface is closed, a manifold, and its triangles agree on their side.
std::vector<std::int32_t> bad_vertices(const TriangleMesh& mesh);

/// Handles of a surface that hangs together and has no bad vertices: 1 − χ/2, χ = V − E + F.
Index genus(const TriangleMesh& part);

}  // namespace hsi4d
