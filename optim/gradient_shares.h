// How much each loss term pulls at each group of parameters.
//
//   g_k = weight_k ∂ term_k / ∂ group,   share_k = |g_k| / Σ_j |g_j|,   cosine_k = g_k · Σ_j g_j / (|g_k| |Σ_j g_j|)
//
// Norms are over all numbers of a group. A term whose cosine is small or negative pulls across the sum or against it.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "optim/adam.h"

namespace hsi4d {

/// One term and one group in one iteration. 0 / 0 is 0.
struct GradientShare {
  std::string group, term;
  double norm = 0;    ///< |g_k|
  double share = 0;   ///< of the sum of the terms' norms, 0 to 1
  double cosine = 0;  ///< with the sum of the terms' gradients, −1 to 1
};

/// A loss as a weighted sum.
template <class S>
struct WeightedTerm {
  std::string name;
  Var<S> value;
  double weight = 1;
};

/// Runs the tape backward once for each term, of values that forward has brought up to date: no node is evaluated
/// again, and nothing is written but gradients, so that a backward of the sum afterwards gives what it would have.
///
/// @param groups     those whose gradients count; a block without a gradient counts as zeros
/// @param iteration  groups that do not move in it are left out
/// @return           groups in their order, of each the terms in theirs; empty when a number is not finite
template <class S>
std::vector<GradientShare> gradient_shares(Tape<S>& tape, std::span<const WeightedTerm<S>> terms,
                                           std::span<const OptimizerGroup<S>> groups, Index iteration);

extern template std::vector<GradientShare> gradient_shares(Tape<float>&, std::span<const WeightedTerm<float>>,
                                                           std::span<const OptimizerGroup<float>>, Index);
extern template std::vector<GradientShare> gradient_shares(Tape<double>&, std::span<const WeightedTerm<double>>,
                                                           std::span<const OptimizerGroup<double>>, Index);

}  // namespace hsi4d
