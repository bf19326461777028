// Parameters that stages move: leaves of a tape under a name that configs know.
#pragma once

#include <string>
#include <vector>

#include "autodiff/tape.h"

namespace hsi4d {

/// What a config's `optimize` names: leaves of one tape that move together. Without leaves it is a name that a config
/// may use although there is nothing to move (no object in the scene).
template <class S>
struct ParameterGroup {
  std::string name;
  std::vector<Var<S>> blocks;
  bool are_axis_angles = false;  ///< each row is a rotation: a stage keeps it within half a turn (wrap_axis_angles)
};

/// The groups' names, in their order.
template <class S>
std::vector<std::string> names_of(const std::vector<ParameterGroup<S>>& groups) {
  std::vector<std::string> names;
  for (const ParameterGroup<S>& group : groups) names.push_back(group.name);
  return names;
}

/// Replaces each row of an axis-angle leaf by the one of the same rotation with |w| ≤ π (row D9 of the stability
/// catalogue). To be called between steps; an optimiser that goes on then clears the moments of these rows
/// (Adam::clear_moments), which belong to the old chart.
///
/// @param axis_angles  [J,3] radians, a leaf; written only if a row changes
/// @return             the rows that changed
/// Adjoint: none, a change of parameters between steps. Throws InternalError for another number of columns.
template <class S>
std::vector<Index> wrap_axis_angles(Var<S> axis_angles);

extern template std::vector<Index> wrap_axis_angles(Var<float>);
extern template std::vector<Index> wrap_axis_angles(Var<double>);

}  // namespace hsi4d
