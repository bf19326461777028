// libhsi4d_volumes.so: the only file that includes OpenVDB. It links nothing of this project.
#include <cmath>
#include <fstream>
#include <openvdb/io/Stream.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/LevelSetRebuild.h>
#include <openvdb/tools/VolumeToMesh.h>

#include "optim/solid/volume_library.h"

namespace hsi4d {
namespace {

using openvdb::Coord;
using openvdb::FloatGrid;

/// Blocks of values become leaves, others tiles, what is beyond them the background. In index space a node is 1 apart.
/// @param sign  −1: solid and free are changed, as a level set is open outside
FloatGrid::Ptr grid_of(const SolidGrid& solid, float sign) {
  openvdb::initialize();
  const auto limit = sign * static_cast<float>(solid.truncation);
  const FloatGrid::Ptr grid = FloatGrid::create(solid.is_outside_free ? limit : -limit);
  grid->setGridClass(openvdb::GRID_LEVEL_SET);
  FloatGrid::TreeType& tree = grid->tree();
  std::size_t number = 0;
  for (std::int32_t i = 0; i < solid.blocks[0]; ++i) {
    for (std::int32_t j = 0; j < solid.blocks[1]; ++j) {
      for (std::int32_t k = 0; k < solid.blocks[2]; ++k) {
        const std::int32_t of = solid.block[number++];
        const Coord first(kSolidBlock * i, kSolidBlock * j, kSolidBlock * k);
        if (of < 0) {
          if ((of == SolidGrid::kFree) != solid.is_outside_free)
            tree.addTile(1, first, of == SolidGrid::kFree ? limit : -limit, false);
          continue;
        }
        FloatGrid::TreeType::LeafNodeType* const leaf = tree.touchLeaf(first);
        const SolidGrid::Values& values = solid.values[static_cast<std::size_t>(of)];
        for (openvdb::Index n = 0; n < kSolidBlockNodes; ++n) leaf->setValueOn(n, sign * values[n]);
      }
    }
  }
  return grid;
}

void make_mesh(const SolidGrid& solid, double adaptivity, TriangleMesh& mesh) {
  std::vector<openvdb::Vec3s> points;
  std::vector<openvdb::Vec3I> triangles;
  std::vector<openvdb::Vec4I> quads;
  openvdb::tools::volumeToMesh(*grid_of(solid, 1), points, triangles, quads, 0.0, adaptivity);
  mesh = {};
  for (const openvdb::Vec3s& p : points)
    mesh.vertices.push_back(solid.origin + solid.voxel * Vector3<double>(p[0], p[1], p[2]));
  const auto add = [&mesh](openvdb::Index32 a, openvdb::Index32 b, openvdb::Index32 c) {
    mesh.faces.push_back({static_cast<std::int32_t>(a), static_cast<std::int32_t>(b), static_cast<std::int32_t>(c)});
  };
  for (const openvdb::Vec3I& t : triangles) add(t[0], t[2], t[1]);
  for (const openvdb::Vec4I& q : quads) {
    const bool first_is_shorter =
        (points[q[0]] - points[q[2]]).lengthSqr() <= (points[q[1]] - points[q[3]]).lengthSqr();
    if (first_is_shorter) {
      add(q[0], q[2], q[1]);
      add(q[0], q[3], q[2]);
    } else {
      add(q[0], q[3], q[1]);
      add(q[1], q[3], q[2]);
    }
  }
}

/// Distances of the surface with the signs of the grid: the rebuilt level set takes all within the outermost surface
/// for one side, also what hangs in a room.
FloatGrid::Ptr distances_of(const SolidGrid& solid, float reach) {
  const float outwards = solid.is_outside_free ? 1.0F : -1.0F, voxel = static_cast<float>(solid.voxel);
  const FloatGrid::Ptr signs = grid_of(solid, 1);
  const FloatGrid::Ptr grid = openvdb::tools::levelSetRebuild(*grid_of(solid, outwards), 0.0F, reach, reach);
  const FloatGrid::ConstAccessor sign_at = signs->getConstAccessor();
  for (auto value = grid->beginValueAll(); value; ++value)
    value.setValue(std::copysign(voxel * *value, sign_at.getValue(value.getCoord())));
  openvdb::tools::changeBackground(grid->tree(), outwards * voxel * reach);
  const openvdb::math::Transform::Ptr place = openvdb::math::Transform::createLinearTransform(solid.voxel);
  place->postTranslate({solid.origin[0], solid.origin[1], solid.origin[2]});
  grid->setTransform(place);
  grid->setName("signed_distance");
  grid->setGridClass(openvdb::GRID_LEVEL_SET);
  return grid;
}

std::string write_distances(const SolidGrid& solid, double reach, const std::string& path) {
  try {
    std::ofstream file(path, std::ios::binary);
    openvdb::io::Stream(file).write(openvdb::GridCPtrVec{distances_of(solid, static_cast<float>(reach))});
    file.close();
    return file ? "" : "the disk may be full";
  } catch (const std::exception& error) {
    return error.what();
  }
}

}  // namespace
}  // namespace hsi4d

extern "C" __attribute__((visibility("default"))) const hsi4d::VolumeLibrary* hsi4d_volume_library() {
  static const hsi4d::VolumeLibrary library = {hsi4d::make_mesh, hsi4d::write_distances};
  return &library;
}
