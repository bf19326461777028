// Affine maps whose numbers stay as they are: layers of a network that is used and not trained.
//
//   y = x Wᵀ + b,   d_x = d_y W
//
// The matrix is kept in both orders, so that the inner loop of either direction runs over neighbours in memory. A row's
// sums are in the same order whatever the number of rows and threads.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "autodiff/tape.h"

namespace hsi4d {

/// W and b of such a map, in precision S. Immutable; copies share the numbers.
template <class S>
class FrozenLinear {
 public:
  /// No map.
  FrozenLinear() = default;
  /// @param weight  [out,in], by rows, as PyTorch has it
  /// @param bias    [out]
  /// Throws InternalError when the counts do not fit.
  FrozenLinear(std::span<const double> weight, std::span<const double> bias);

  struct Tables {
    std::vector<S> by_input, by_output;  // [in,out] and [out,in]
    std::vector<S> bias;
  };
  const Tables& tables() const { return *tables_; }
  Index inputs() const { return inputs_; }
  Index outputs() const { return outputs_; }

 private:
  Index inputs_ = 0, outputs_ = 0;
  std::shared_ptr<const Tables> tables_;
};

/// y = x Wᵀ + b.
///
/// @param x  [N,in]
/// @return   [N,out]
/// Adjoint: x. The map has none.
/// Throws InternalError when x has another width.
template <class S>
Var<S> frozen_linear(const FrozenLinear<S>& map, Var<S> x, Source where = Source::current());

}  // namespace hsi4d
