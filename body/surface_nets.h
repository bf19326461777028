// Surfaces of functions of space, as closed triangle meshes.
//
// Surface nets [Gibson 1998]: every cell of a grid that the surface crosses has one vertex, at the mean of the
// crossings of its edges; every edge of the grid that the surface crosses has one quadrangle between the four cells
// around it. The grid may be bent by a smooth map, which makes cells finer where the surface has more detail.
#pragma once

#include <array>
#include <vector>

#include "core/linear.h"
#include "core/types.h"

namespace hsi4d::detail {

/// A grid of nodes, evenly spaced before the map bends it.
struct NetGrid {
  Vector3<double> low;  ///< the first node
  double cell;          ///< distance of nodes
  std::array<int, 3> nodes;
};

struct NetMesh {
  std::vector<Vector3<double>> vertices;
  std::vector<std::int32_t> faces;  ///< [F,3], counter-clockwise seen from where the field is positive
};

/// The surface field = 0 that encloses `inside`, followed from cell to cell.
///
/// The vertices are then moved onto the surface by Newton's steps, and evened out along it.
///
/// @param map     from the grid's space to that of the field; smooth, orientation kept
/// @param field   about the signed distance, negative inside
/// @param inside  a point of the grid's space where the field is negative
/// Throws InternalError when the surface leaves the grid, or `inside` is not inside.
NetMesh surface_net(const NetGrid& grid, FunctionRef<Vector3<double>(const Vector3<double>&)> map,
                    FunctionRef<double(const Vector3<double>&)> field, const Vector3<double>& inside);

/// Vertices that share an edge with each vertex: those of v are `neighbours[begin[v] … begin[v+1])`, ascending.
struct VertexNeighbours {
  std::vector<Index> begin;
  std::vector<std::int32_t> neighbours;
};
VertexNeighbours vertex_neighbours(Index vertices, const std::vector<std::int32_t>& faces);

}  // namespace hsi4d::detail
