#include "optim/solid/solid_mesh.h"

#include <cmath>

#include "core/check.h"
#include "core/file.h"
#include "optim/solid/mesh_topology.h"
#include "optim/solid/volume_library.h"

namespace hsi4d {

namespace {

/// Makes the free nodes of the cell around a place solid. Returns whether there were any.
bool fill_cell(SolidGrid& grid, const Vector3<double>& place) {
  const Vector3<double> at = (place - grid.origin) / grid.voxel;
  bool some = false;
  for (std::int32_t corner = 0; corner < 8; ++corner) {
    NodePlace node, block;
    for (std::size_t i = 0; i < 3; ++i) {
      node[i] = static_cast<std::int32_t>(std::floor(at[static_cast<Index>(i)])) + (corner >> i & 1);
      block[i] = node[i] >= 0 ? node[i] / kSolidBlock : -1;
    }
    if (!grid.holds_block(block) || grid.at(node) < 0) continue;
    const std::int32_t of = with_values(grid, grid.number(block));
    grid.values[static_cast<std::size_t>(of)][static_cast<std::size_t>(
        index_in_block(node[0] % kSolidBlock, node[1] % kSolidBlock, node[2] % kSolidBlock))] = -0.5F;
    some = true;
  }
  return some;
}

}  // namespace

TriangleMesh surface_of(SolidGrid& grid, double adaptivity) {
  for (int round = 0; round <= kMostMendings; ++round) {
    add_values_at_borders(grid);
    TriangleMesh raw;
    volume_library().mesh(grid, adaptivity, raw);
    if (raw.faces.empty()) throw UserError("there is no surface: nothing is solid, or nothing is free");
    TriangleMesh mesh = cleaned(raw, "the surface");
    const std::vector<std::int32_t> bad = bad_vertices(mesh);
    if (bad.empty()) return mesh;
    bool changed = false;
    for (const std::int32_t v : bad) changed |= fill_cell(grid, mesh.vertices[static_cast<std::size_t>(v)]);
    if (!changed) adaptivity = 0;  // it is where triangles were joined that the surface touches itself
  }
  throw UserError("the surface touches itself in places that cannot be mended; another voxel size may do");
}

void write_distances(const std::string& path, const SolidGrid& grid, double reach) {
  AtomicFile file(path);
  const std::string problem = volume_library().write_distances(grid, reach, file.temporary_path());
  if (!problem.empty()) throw UserError(path + ": cannot be written: " + problem);
  file.commit();
}

}  // namespace hsi4d
