// Adam as the textbook has it, number by number: in long double it is the truth, in float what goes wrong without a
// look at the gradient and without flushing. And leaves for the program's own.
#pragma once

#include <cmath>
#include <utility>
#include <vector>

#include "optim/adam.h"

namespace hsi4d::stress {

/// One parameter. [Kingma and Ba 2015, algorithm 1; eps added to the root]
template <class S>
struct PlainAdam {
  S lr;
  S beta1 = S(0.9), beta2 = S(0.999), eps = S(1e-8);
  S x = 0, m = 0, v = 0;
  int t = 0;

  void step(S g) {
    ++t;
    m = beta1 * m + (1 - beta1) * g;
    v = beta2 * v + (1 - beta2) * g * g;
    const S m_hat = m / (1 - std::pow(beta1, S(t))), v_hat = v / (1 - std::pow(beta2, S(t)));
    x -= lr * m_hat / (std::sqrt(v_hat) + eps);
  }
};

inline bool is_denormal(double x) { return std::fpclassify(x) == FP_SUBNORMAL; }

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
