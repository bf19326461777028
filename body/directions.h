// Displacements of points that are linear in a few numbers: shape and expression of a body, and its pose correctives.
//
//   y = x + P c        P [3V,C], c [C]            d_x = d_y,   d_c = Pᵀ d_y
//
// P of a body's pose correctives has 31,425 × 486 numbers, which no cache near the processor holds, so the time is that
// of reading P, once forward and once backward. Hence P is cut into tiles, the rows of 32 vertices by the columns of
// one group (one joint), which lie in the order in which both directions read them:
// - tiles of zeros are left out;
// - in float, a tile may be packed into whole numbers of 16 bits with a scale of its own. A number is then off by at
//   most scale/2, scale = largest/32767. Tiles are packed, those with the smallest numbers first, while the largest
//   error that a row can have,
//     Σ_groups reach_g · scale/2,       reach_g = largest Σ |c| over the columns of the group
//   is within a bound that the caller gives; the others stay as they are. The adjoint is that of the packed numbers.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "autodiff/tape.h"

namespace hsi4d {

namespace detail {
template <class S>
struct DirectionTiles;
}

/// Numbers of P as they are read: `values[row * row_stride + column]`, rows are coordinates (3v + i).
struct DirectionSource {
  std::span<const double> values;
  Index vertices = 0, row_stride = 0;
  std::vector<Index> group_begin;  ///< first column of each group; a group has `group_columns` columns
  Index group_columns = 0;
};

/// How far packing may move a coordinate.
struct DirectionPacking {
  double largest_error = 0;  ///< metres, over all groups; 0: nothing is packed
  double reach = 0;          ///< largest Σ |c| over the columns of a group
};

/// P, prepared for the kernels in precision S. Immutable; copies share the numbers.
template <class S>
class Directions {
 public:
  /// No columns: y = x.
  Directions() = default;
  /// `packing` applies to float; double is never packed. Throws InternalError when the source's sizes do not fit.
  explicit Directions(const DirectionSource& source, const DirectionPacking& packing = {});

  Index vertices() const;
  /// C, the columns of the groups one after the other.
  Index columns() const;
  /// Memory of the numbers, which a run of the kernels reads once.
  Index bytes() const;
  /// The largest error of a coordinate by packing, metres, for coefficients within the packing's reach.
  double largest_error() const;
  const detail::DirectionTiles<S>& tiles() const { return *tiles_; }

 private:
  std::shared_ptr<const detail::DirectionTiles<S>> tiles_;
};

/// result = points + P c, not taped. `result` may be `points`.
///
/// @param coefficients  [C]
/// @param points        [V,3] metres
template <class S>
void add_directions(const Directions<S>& directions, const S* coefficients, const S* points, S* result);

/// Numbers that gather_directions needs as scratch memory.
template <class S>
Index gather_scratch(const Directions<S>& directions);

/// sums[C] = Pᵀ d_result, float partial sums of 2,048 vertices added in double; the same bits for any number of
/// threads.
///
/// @param d_result  [V,3]
/// @param scratch   gather_scratch numbers
template <class S>
void gather_directions(const Directions<S>& directions, const S* d_result, S* scratch, double* sums);

}  // namespace hsi4d
