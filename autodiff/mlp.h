// A multi-layer perceptron that every row of an array goes through, fused into one operator.
//
//   x_n = (rows_n, more_n, code)                     the code is shared by all rows
//   y_1 = a(x W_1 + b_1),  y_l = a(y_{l−1} W_l + b_l),  z = y_{L−1} W_L + b_L + offset,   out = z or sigmoid(z)
//
//   a(z) = z (1 + t)/2,  t = z/√(1 + z²)
//
// The activation follows z for large z and 0 for small ones, as max(0, z), but has all derivatives: a gradient check
// then sees no kinks, of which every weight would meet as many as there are rows. It needs no division and no
// exponential (docs/numerics/body.md says what that is worth).
//
// The code meets its rows of W_1 once per evaluation, not once a row. Hidden values are not kept from forward to
// backward but made again, block by block, in the first- and second-level cache. Sums over rows are taken in S within a
// chunk of them, lane by lane in a block of 192 and then block by block; the chunks' are added up in double, pairwise.
#pragma once

#include <span>

#include "autodiff/tape.h"

namespace hsi4d {

/// Most layers of a network, the last one included.
inline constexpr int kMostMlpLayers = 8;

/// What a network reads. A Var without a tape is not there.
template <class S>
struct MlpInputs {
  Var<S> rows;    ///< [N,F]
  Var<S> more;    ///< [N,E] more numbers of each row, or empty
  Var<S> code;    ///< [1,P] of all rows, or empty
  Var<S> offset;  ///< [N,C] added before the output function, or empty
};

/// One layer. The first one has its inputs in the order rows, more, code.
template <class S>
struct MlpLayer {
  Var<S> weights;  ///< [inputs, outputs]
  Var<S> bias;     ///< [1, outputs]
};

enum class MlpOutput { kLinear, kSigmoid };

/// The network's output for every row.
///
/// @param layers  1 to kMostMlpLayers; the activation stands between them, not after the last
/// @return        [N,C], C the outputs of the last layer
/// Adjoint: rows, more, code, offset, all weights and biases; nothing is computed for those that are frozen, and
/// nothing of the layers before the first that anything is wanted of. The sigmoid's is right far into saturation
/// (row B15: saturated sigmoid). Throws InternalError when the shapes do not fit.
template <class S>
Var<S> mlp(const MlpInputs<S>& inputs, std::span<const MlpLayer<S>> layers, MlpOutput output,
           Source where = Source::current());

/// Multiply-adds of one forward run for `rows` rows, without the activation.
/// @param widths  per-row inputs (rows and more), then the outputs of each layer
double mlp_multiply_adds(Index rows, std::span<const Index> widths);

}  // namespace hsi4d
