// What is free and what is solid, as signed distances on a grid of which only what lies near a surface takes memory.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/linear.h"
#include "core/types.h"
#include "optim/solid/occupancy_grid.h"

namespace hsi4d {

/// Nodes along a side of a block of a SolidGrid: those of a leaf of OpenVDB.
inline constexpr std::int32_t kSolidBlock = 8;
inline constexpr std::int32_t kSolidBlockNodes = kSolidBlock * kSolidBlock * kSolidBlock;

/// A place on a grid, of nodes or blocks.
using NodePlace = std::array<std::int32_t, 3>;

/// Signed distances at nodes: positive in free space, negative in the solid, 0 counts as free. Node (i, j, k) lies at
/// origin + voxel (i, j, k). They come in blocks of 8³ nodes, each of values, or all free or all solid; beyond the
/// grid all is what `is_outside_free` says.
struct SolidGrid {
  using Values = std::array<float, kSolidBlockNodes>;  ///< z fastest, then y; voxels, held within ±truncation
  static constexpr std::int32_t kFree = -1, kSolid = -2;

  double voxel = 0;                                  ///< metres between two nodes
  double truncation = 3;                             ///< voxels
  Vector3<double> origin = Vector3<double>::Zero();  ///< metres, world
  NodePlace blocks = {0, 0, 0};                      ///< along x, y, z
  bool is_outside_free = false;
  std::vector<std::int32_t> block;  ///< [X,Y,Z], z fastest: its number in `values`, kFree or kSolid
  std::vector<Values> values;

  Index block_count() const { return Index{blocks[0]} * blocks[1] * blocks[2]; }
  Index number(const NodePlace& place) const { return (Index{place[0]} * blocks[1] + place[1]) * blocks[2] + place[2]; }
  NodePlace place_of_block(Index number) const;
  bool holds_block(const NodePlace& place) const;
  /// The distance at a node, voxels; ±truncation where there are no values.
  float at(const NodePlace& node) const;
  /// Between nodes, trilinearly, metres. By several threads at once.
  double at(const Vector3<double>& point) const;
  Vector3<double> place_of_node(const NodePlace& node) const;
  /// Bytes of values and blocks.
  Index memory_bytes() const;
};

/// The number of a node in its block.
inline Index index_in_block(Index i, Index j, Index k) { return (i * kSolidBlock + j) * kSolidBlock + k; }

/// Gives values to a block that has none, those that it stands for. Returns its number in `values`.
std::int32_t with_values(SolidGrid& grid, Index block);

/// What a clean-up changed.
struct CleanUp {
  Index closed_pockets = 0, closed_nodes = 0;  ///< free, but not to be reached
  Index removed_specks = 0, removed_nodes = 0;
};

/// Makes solid what is free but not reached, from node to node along the axes, from the seeds or, with
/// is_outside_free, from the outside; and free each connected piece of the solid of fewer than `smallest` nodes that
/// does not touch a solid outside. So free space and solid are a partition.
///
/// @param seeds  metres, world: places in free space; those that lie in the solid or outside are passed over
CleanUp clean_up(SolidGrid& grid, std::span<const Vector3<double>> seeds, Index smallest);

/// Which cubes of `voxel` metres have a solid middle, over the box of the grid without its blocks of the outside.
/// @param is_y_up  the result's axes: (x, y, z) of the world becomes (x, z, −y)
/// Throws UserError where there would be more than kMostVoxels, or than 16384 along an axis.
OccupancyGrid occupancy_of(const SolidGrid& grid, double voxel, bool is_y_up);

/// Gives values to blocks without them that touch one of the other kind, so that each change of sign lies between nodes
/// with values.
void add_values_at_borders(SolidGrid& grid);

}  // namespace hsi4d
