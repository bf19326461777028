// Parameters that stages move: leaves of a tape under a name that configs know.
#pragma once

#include <cmath>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "autodiff/tape.h"

namespace hsi4d {

/// The numbers that a parameter may have.
struct ParameterRange {
  double low = 0, high = 1;
};

/// What a config's `optimize` names: leaves of one tape that move together. Without leaves it is a name that a config
/// may use although there is nothing to move (no object in the scene).
template <class S>
struct ParameterGroup {
  std::string name;
  std::vector<Var<S>> blocks;
  bool are_axis_angles = false;  ///< each row is a rotation: a stage keeps it within half a turn (wrap_axis_angles)
  std::optional<ParameterRange> range = {};  ///< a stage keeps every number in it (hold_in_range)
  /// By block, where each has its own, infinite where that has none; then no `range`. Must outlive the group.
  std::span<const ParameterRange> block_ranges = {};

  /// What the numbers of a block are kept in; none: nothing.
  std::optional<ParameterRange> range_of(std::size_t block) const {
    return block_ranges.empty() ? range : block_ranges[block];
  }
  bool has_range() const {
    for (const ParameterRange& of_block : block_ranges) {
      if (std::isfinite(of_block.low) || std::isfinite(of_block.high)) return true;
    }
    return range.has_value();
  }
};

/// The groups' names, in their order.
template <class S>
std::vector<std::string> names_of(const std::vector<ParameterGroup<S>>& groups) {
  std::vector<std::string> names;
  for (const ParameterGroup<S>& group : groups) names.push_back(group.name);
  return names;
}

/// Replaces each row of an axis-angle leaf by the one of the same rotation with |w| ≤ π (row D9: angles grow
/// past a turn). To be called between steps; an optimiser that goes on then clears the mean gradient of these
/// rows (Adam::clear_mean), which belongs to the old chart.
///
/// @param axis_angles  [J,3] radians, a leaf; written only if a row changes
/// @return             the rows that changed
/// Adjoint: none, a change of parameters between steps. Throws InternalError for another number of columns.
template <class S>
std::vector<Index> wrap_axis_angles(Var<S> axis_angles);

/// Puts every number of a leaf that is out of the range on its nearer end: the projection of a step onto what is
/// allowed [gradient projection: Bertsekas 1976]. Where an operator clamps the parameter to the same range, its
/// gradient is that of the inside at the ends too, so that a number which was pushed against an end can come back;
/// beyond it would have none, and stay.
///
/// @param leaf  written only if a number changes
/// @return      whether one did
/// Adjoint: none, a change of parameters between steps. Moments of an optimiser remain right.
template <class S>
bool hold_in_range(Var<S> leaf, const ParameterRange& range);

extern template bool hold_in_range(Var<float>, const ParameterRange&);
extern template bool hold_in_range(Var<double>, const ParameterRange&);
extern template std::vector<Index> wrap_axis_angles(Var<float>);
extern template std::vector<Index> wrap_axis_angles(Var<double>);

}  // namespace hsi4d
