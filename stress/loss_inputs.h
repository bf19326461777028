// Everything that a loss term may read, in one small case: a human of a few Gaussians beside two objects on a floor.
#pragma once

#include <vector>

#include "optim/loss_term.h"

namespace hsi4d::stress {

/// Sizes: the frame; frames of the motion, of which the first stand; Gaussians of the body and of each object.
inline constexpr Index kLossHeight = 13, kLossWidth = 21, kLossFrames = 5, kLossStill = 2, kLossBodyRows = 60,
                       kLossObjectRows = 30, kLossObjects = 2;

/// Leaves for every input, all with a gradient, and the inputs made of them.
template <class S>
struct LossLeaves {
  std::vector<Var<S>> leaves;
  LossInputs<S> inputs;
};

/// Records them with numbers that make sense. Both objects are seen.
template <class S>
LossLeaves<S> loss_leaves(Tape<S>& tape);

extern template LossLeaves<float> loss_leaves(Tape<float>&);
extern template LossLeaves<double> loss_leaves(Tape<double>&);

}  // namespace hsi4d::stress
