// Sums and means. All are accumulated in double in a fixed order.
#pragma once

#include "autodiff/tape.h"

namespace hsi4d {

/// Σ of all numbers: a scalar. Adjoint: x.
template <class S>
Var<S> sum(Var<S> x, Source where = Source::current());

/// Mean of all numbers: a scalar. Throws InternalError for an empty array. Adjoint: x.
template <class S>
Var<S> mean(Var<S> x, Source where = Source::current());

/// [P,N,C] → [1,C]: the sum over planes and rows of each column. Adjoint: x.
template <class S>
Var<S> sum_rows(Var<S> x, Source where = Source::current());

/// [P,N,C] → [P,N,1]: the sum of each row. Adjoint: x.
template <class S>
Var<S> sum_cols(Var<S> x, Source where = Source::current());

/// Euclidean norm of each row, [N,C] → [N,1]. The gradient at a zero row is 0 (row D5: distance 0). Adjoint: x.
template <class S>
Var<S> norm_cols(Var<S> x, Source where = Source::current());

}  // namespace hsi4d
