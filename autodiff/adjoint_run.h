// Where the partial derivatives of a block of elements are added, for every operator of map.h alike: compiled once.
#pragma once

#include "core/types.h"

namespace hsi4d::detail {

/// What partial derivatives are multiplied by: a number each, or one for all.
template <class S>
struct Weights {
  const S* each;  ///< null: `all`
  S all;
};

/// The place of a block in the adjoint of one operand.
template <class S>
struct AdjointRun {
  S* d;
  double* slot;     ///< of the chunk, where several chunks share the operand; null: `d` itself
  bool assigns;     ///< `d` is assigned, not added to
  bool one_number;  ///< all elements of the block belong to one number of the operand
};

/// Adds partial[i] · weight_i for i in [0, n), n ≤ kBlock; by vector code, the same bits on every instruction set.
template <class S>
void add_weighted(const AdjointRun<S>& run, const S* partial, const Weights<S>& weights, Index n);

}  // namespace hsi4d::detail
