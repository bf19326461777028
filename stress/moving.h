// Leaves that Adam moves at one rate.
#pragma once

#include <utility>
#include <vector>

#include "optim/adam.h"

namespace hsi4d::stress {

/// The group "all".
template <class S>
AdamGroup<S> moving_at(std::vector<Var<S>> leaves, double lr) {
  AdamGroup<S> group;
  group.parameters.name = "all";
  group.parameters.blocks = std::move(leaves);
  group.settings.lr = lr;
  return group;
}

}  // namespace hsi4d::stress
