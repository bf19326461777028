// Adam for arrays of very many rows, of which an iteration sees some: Gaussians of a scene, from one of its views.
//
// As Adam (optim/adam.h), row by row: a row whose gradient is zero stands still, and its moments stay [as the selective
// Adam of gsplat]. Each row counts its own steps, so that the first step of a row that is new, or seen for the first
// time, is as long as the rate, and none is longer than a step of Adam. Moments have the parameters' precision; nothing
// is kept to take a step back: a row whose gradient is not finite, or beyond kLargestGradient, stays as it is.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "autodiff/tape.h"

namespace hsi4d {

/// What rows have accumulated; row-major without padding. Empty: nothing yet.
template <class S>
struct RowMoments {
  std::vector<S> mean, square;
  std::vector<std::int32_t> steps;  ///< of each row

  /// Of `rows` rows of `cols` numbers: what is there stays, rows that are new have nothing.
  void resize(Index rows, Index cols);
  /// Forgets all that one row has accumulated.
  void clear_row(Index row, Index cols);
  bool operator==(const RowMoments&) const = default;
};

/// How rows move.
struct RowAdamRule {
  double rate = 0;
  double beta1 = 0.9, beta2 = 0.999, eps = 1e-15;
  std::span<const float> column_shares = {};  ///< of the rate, a number a column; empty: 1
};

/// What a step did.
struct RowAdamReport {
  Index moved = 0;    ///< rows
  Index refused = 0;  ///< rows whose gradient was no number to go by
};

/// Corrections 1 − βᵗ for t = 0 … `steps`.
std::vector<double> bias_corrections(double beta, Index steps);

/// One step of all rows of a leaf, by the gradient of the tape's last backward; without one nothing moves. Bitwise the
/// same for any number of threads.
///
/// @param leaf                    [N,C]
/// @param moments                 of N rows
/// @param first, second           bias_corrections of beta1 and beta2, of as many steps as a row may have
/// Throws InternalError for moments or shares of other sizes.
template <class S>
RowAdamReport step_rows(Var<S> leaf, RowMoments<S>& moments, const RowAdamRule& rule, std::span<const double> first,
                        std::span<const double> second);

extern template struct RowMoments<float>;
extern template struct RowMoments<double>;
extern template RowAdamReport step_rows(Var<float>, RowMoments<float>&, const RowAdamRule&, std::span<const double>,
                                        std::span<const double>);
extern template RowAdamReport step_rows(Var<double>, RowMoments<double>&, const RowAdamRule&, std::span<const double>,
                                        std::span<const double>);

}  // namespace hsi4d
