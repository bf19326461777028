// Matrix products, and operators that move rows and columns.
#pragma once

#include <vector>

#include "autodiff/tape.h"

namespace hsi4d {

/// Matrix product [N,K] · [K,M] → [N,M]. Adjoint: a, b. Throws InternalError when the sizes do not fit.
template <class S>
Var<S> matmul(Var<S> a, Var<S> b, Source where = Source::current());

/// [N,M] → [M,N]. Adjoint: x.
template <class S>
Var<S> transpose(Var<S> x, Source where = Source::current());

/// The same numbers in row-major order as [rows, cols]. Adjoint: x. Throws InternalError when the counts differ.
template <class S>
Var<S> reshape(Var<S> x, Index rows, Index cols, Source where = Source::current());

/// Rows [first, first + count) of a one-plane array. Adjoint: x.
template <class S>
Var<S> slice_rows(Var<S> x, Index first, Index count, Source where = Source::current());

/// Columns [first, first + count) of a one-plane array. Adjoint: x.
template <class S>
Var<S> slice_cols(Var<S> x, Index first, Index count, Source where = Source::current());

/// Planes [first, first + count). Adjoint: x.
template <class S>
Var<S> slice_planes(Var<S> x, Index first, Index count, Source where = Source::current());

/// One-plane arrays of equal width stacked on top of each other. Adjoint: every part.
template <class S>
Var<S> concat_rows(std::span<const Var<S>> parts, Source where = Source::current());

/// One-plane arrays of equal height side by side. Adjoint: every part.
template <class S>
Var<S> concat_cols(std::span<const Var<S>> parts, Source where = Source::current());

/// y_i = x_{index[i]} for rows of a one-plane array. Adjoint: x, gathered over the transposed index (no scatter).
/// Throws InternalError naming the position of an index outside of x.
template <class S>
Var<S> gather_rows(Var<S> x, std::vector<std::uint32_t> index, Source where = Source::current());

}  // namespace hsi4d
