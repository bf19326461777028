// What this project takes from OpenVDB, as a library of its own that is loaded when it is first needed
// (core/loaded_library.h).
#pragma once

#include <string>

#include "optim/solid/mesh_file.h"
#include "optim/solid/solid_grid.h"

namespace hsi4d {

/// The library's functions; the grid has values at its borders (add_values_at_borders).
struct VolumeLibrary {
  /// The surface between free space and solid, counter-clockwise seen from the free side.
  /// @param adaptivity  0 to 1: how far from flat the surface may be where triangles become larger
  void (*mesh)(const SolidGrid& grid, double adaptivity, TriangleMesh& mesh);
  /// Writes signed distances within `reach` voxels of the surface as a level set, "signed_distance" (.vdb), metres.
  /// Returns what was wrong, or "".
  std::string (*write_distances)(const SolidGrid& grid, double reach, const std::string& path);
};

/// Loads it at the first call. For several threads at once. Throws InternalError as function_of_library.
const VolumeLibrary& volume_library();

}  // namespace hsi4d
