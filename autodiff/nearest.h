// Where two sets of points come nearest to each other.
#pragma once

#include <vector>

#include "autodiff/tape.h"

namespace hsi4d {

/// Rows [first_point, first_point + points) of one array and [first_target, first_target + targets) of another.
struct NearestSet {
  Index first_point = 0, points = 0, first_target = 0, targets = 0;
};

/// y_s = p_i − q_j of the pair of set s with the least |p_i − q_j|, the first one where several are as near. It is
/// chosen anew in every forward, by trying all pairs.
///
/// @param points   [P,3]
/// @param targets  [Q,3]
/// @param sets     each with a point and a target at least
/// @return         [S,3]
/// Adjoint: points, targets, of the pair as it is: where another pair becomes the nearest, y jumps and |y|² has a kink
/// (the gradient of min |p − q|² is that of the pair that has it). A pair whose distance is no number is not nearest
/// where another one has a distance. Throws InternalError for a set without a pair or beyond the arrays.
template <class S>
Var<S> nearest_pairs(Var<S> points, Var<S> targets, std::vector<NearestSet> sets, Source where = Source::current());

extern template Var<float> nearest_pairs(Var<float>, Var<float>, std::vector<NearestSet>, Source);
extern template Var<double> nearest_pairs(Var<double>, Var<double>, std::vector<NearestSet>, Source);

}  // namespace hsi4d
