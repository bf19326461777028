// What is solid as a grid of voxels, free or occupied, and the signed distance to it.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/linear.h"
#include "core/types.h"

namespace hsi4d {

/// Voxels of a grid at most.
inline constexpr Index kMostVoxels = Index{1} << 28U;

/// A grid of cubes: voxel (i, j, k) reaches from origin + h (i, j, k) to origin + h (i+1, j+1, k+1).
struct OccupancyGrid {
  std::array<Index, 3> cells = {0, 0, 0};            ///< X, Y, Z
  Vector3<double> origin = Vector3<double>::Zero();  ///< metres, in the grid's own axes
  double voxel_size = 0;                             ///< h, metres
  bool is_y_up = false;                              ///< the grid's axes: y up, as of TRUMANS and LINGO; else z up
  std::vector<std::uint8_t> occupied;                ///< [X,Y,Z], z fastest; 1 or 0
};

/// Reads a grid (.npz): `occupancy` [X,Y,Z] of booleans or of numbers 0 and 1, `origin` [3] and `voxel_size` (a number,
/// or three that are equal) in metres; the text `up`, "z" (without it too) or "y", which of its axes is up.
///
/// Throws UserError when the file cannot be read; DataError naming file and array: missing, a shape that does not fit,
/// a number that is not finite or beyond 1e6, a size outside 1e-4 to 10 m, more than kMostVoxels, or than 16384 along
/// an axis; a grid in which no voxel is occupied, or none is free. Arrays that claim more than kMostVoxels doubles are
/// refused before memory is taken for them.
OccupancyGrid read_occupancy(const std::string& path);
/// As read_occupancy, of a file in memory. @param name  what messages call it
OccupancyGrid decode_occupancy(std::span<const std::uint8_t> file, const std::string& name);

/// Writes a grid so that read_occupancy gives the same: `occupancy` as bytes of 0 and 1, deflated; in one step. Throws
/// InternalError for an array that is not of the grid's size; UserError as write_file (core/file.h).
void write_occupancy(const std::string& path, const OccupancyGrid& grid);

/// The squared distance of every voxel to the nearest one of the set, in voxels, between centres: exact integers.
///
///   D(p) = min_{q ∈ S} |p − q|²                    [Felzenszwalb and Huttenlocher 2012, one axis after the other]
///
/// @param set  [X,Y,Z], z fastest: 1 in the set; not empty
/// Throws InternalError for sizes that do not fit, or an empty set.
std::vector<std::int32_t> squared_voxel_distances(const std::vector<std::uint8_t>& set,
                                                  const std::array<Index, 3>& cells);

/// The signed distance to the surface between free and occupied voxels: positive in free space, negative in the solid.
/// At the centre of a voxel it is ±(h √D − h/2), D to the nearest voxel of the other kind; between centres it is
/// trilinear. So a wall along the axes has its exact distance, and any other place is within about a voxel of it.
class OccupancyDistance {
 public:
  /// Takes 10 bytes a voxel while it is made, 4 after it. Throws InternalError when no voxel is occupied, or none is
  /// free.
  explicit OccupancyDistance(const OccupancyGrid& grid);

  /// Metres; NaN outside of the grid, of which nothing is known. By several threads at once.
  /// @param point  metres, world (z up)
  double at(const Vector3<double>& point) const;

 private:
  double node(Index i, Index j, Index k) const;

  std::array<Index, 3> cells_;
  Vector3<double> origin_;
  double voxel_size_;
  bool is_y_up_;
  std::vector<float> nodes_;  // at the centres of voxels, metres
};

}  // namespace hsi4d
