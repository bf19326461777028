// L = Σ x², x what is looked for of the clip beside what its files say: logarithms of factors, metres, betas. So a
// frame that does not tell it leaves it as it was given.
#include "autodiff/elementwise.h"
#include "autodiff/reduce.h"
#include "optim/losses/list.h"

namespace hsi4d {

namespace {

/// A tenth more or less costs 1e-4, little beside a photometric loss of a few hundredths.
constexpr double kWeightOfUnknowns = 0.01;

}  // namespace

LossTerm unknowns_prior_loss() {
  LossTerm term = needing({LossInput::kUnknowns},
                          make_loss_term("unknowns_prior",
                                         "Sum of squares of what a stage finds of the clip: focal length, sizes, "
                                         "betas",
                                         [](const auto& in) { return sum(square(in.unknowns)); }));
  term.description.weight = kWeightOfUnknowns;
  return term;
}

}  // namespace hsi4d
