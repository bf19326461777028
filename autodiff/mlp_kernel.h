// The vector kernels behind autodiff/mlp.h. Not part of the public interface.
//
// They work on blocks of kMlpBlock rows, rows in the lanes: an array [width][kMlpBlock] holds number i of every row in
// line i, so that a weight meets whole vectors of rows and no width has to fit the vectors.
#pragma once

#include "core/types.h"

namespace hsi4d::detail {

/// Rows of a block: a whole number of three vectors, whatever the instruction set and type.
inline constexpr Index kMlpBlock = 192;
/// Most lanes of a vector.
inline constexpr Index kMlpLanes = 16;

/// One layer, z_t = b_t + Σ_k W_kt x_k.
template <class S>
struct MlpStep {
  const S* weights;  ///< [inputs, outputs]
  const S* bias;     ///< [outputs]
  Index inputs, outputs;
};

/// The kernels of one instruction set. x is [inputs][kMlpBlock]; y, z, slope and d_z are [outputs][kMlpBlock].
template <class S>
struct MlpKernels {
  /// z of a layer.
  void (*linear)(const MlpStep<S>& step, const S* x, S* z);
  /// y = a(z), the activation of mlp.h.
  void (*hidden)(const MlpStep<S>& step, const S* x, S* y);
  /// The same, and slope = a'(z).
  void (*hidden_with_slope)(const MlpStep<S>& step, const S* x, S* y, S* slope);
  /// d_x_k = slope_k Σ_t W_kt d_z_t; slope is that of x, null for 1.
  void (*to_inputs)(const MlpStep<S>& step, const S* d_z, const S* slope, S* d_x);
  /// sums [inputs, outputs] += Σ_rows x_k d_z_t.
  void (*to_weights)(const MlpStep<S>& step, const S* x, const S* d_z, S* sums);
  /// sums [outputs] += Σ_rows d_z_t.
  void (*to_bias)(const MlpStep<S>& step, const S* d_z, S* sums);
};

/// The kernels of the best instruction set.
template <class S>
MlpKernels<S> mlp_kernels();

}  // namespace hsi4d::detail
