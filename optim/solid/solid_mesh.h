// The closed surface of a solid on a grid.
#pragma once

#include "optim/solid/mesh_file.h"
#include "optim/solid/solid_grid.h"

namespace hsi4d {

/// The surface between free space and solid: closed, a manifold, counter-clockwise seen from the free side.
///
/// Where two edges of the solid touch in a line or a point, the surface would be none: free nodes beside such a place
/// become solid in `grid` until there is none; where that does not help, all triangles stay small. A passage of one
/// node may be closed by it.
///
/// @param grid        clean_up has been called
/// @param adaptivity  0: all triangles are about a voxel large; to 1: larger where the surface is flat
/// Throws UserError where there is no surface, or where it still touches itself after kMostMendings rounds.
TriangleMesh surface_of(SolidGrid& grid, double adaptivity);

inline constexpr int kMostMendings = 50;

/// Writes the signed distance within `reach` voxels of the surface as a level set of OpenVDB (.vdb), metres. In one
/// step. Throws UserError when the file cannot be written.
void write_distances(const std::string& path, const SolidGrid& grid, double reach);

}  // namespace hsi4d
