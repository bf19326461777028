// Leaves that Adam moves at one rate.
#pragma once

#include <utility>
#include <vector>

#include "optim/adam.h"

namespace hsi4d::stress {

/// The group "all".
template <class S>
OptimizerGroup<S> moving_at(std::vector<Var<S>> leaves, double lr) {
  OptimizerGroup<S> group;
  group.parameters.name = "all";
  group.parameters.blocks = std::move(leaves);
  group.settings.lr = lr;
  return group;
}

}  // namespace hsi4d::stress
