// Rows P: what is not a number, and what is extreme, in every input of every operator with an adjoint.
#include "stress/poison.h"

#include <array>

namespace hsi4d {

std::span<const StressCase> poison_cases() {
  using namespace stress;
  static constexpr const char* kRemedy = "rows are taken by index, not by a product with ones and zeros";
  static constexpr std::array kCases = {
      StressCase{"P1", "a bad row makes others bad: elementwise operators", kRemedy, poisoned_elements},
      StressCase{"P2", "a bad row makes others bad: arrays, means, images", kRemedy, poisoned_arrays},
      StressCase{"P3", "a bad row makes others bad: rotations, networks", kRemedy, poisoned_networks},
      StressCase{"P4", "a bad Gaussian makes others bad: projection, colours", kRemedy, poisoned_splats},
      StressCase{"P5", "a bad Gaussian spoils the image: compositing", "a gate, not a factor of 0", poisoned_composite},
      StressCase{"P6", "a bad Gaussian spoils the image: a whole render", "a gate, not a factor of 0", poisoned_render},
      StressCase{"P7", "a bad frame or joint makes others bad: skeletons", kRemedy, poisoned_skeletons},
      StressCase{"P8", "a bad frame or point makes others bad: poses, colours", kRemedy, poisoned_body_nets},
      StressCase{"P9", "pixels and objects that do not count spoil a loss", "a gate, not a factor of 0",
                 poisoned_masks},
      StressCase{"P10", "a loss that is no number moves the parameters", "gradients are looked at before a step",
                 poisoned_losses},
      StressCase{"P11", "a bad point makes others bad: distances", kRemedy, poisoned_distances},
  };
  return kCases;
}

stress::OperatorNames stress::poisoned_operators() {
  OperatorNames names;
  for (const auto add :
       {add_autodiff_operators, add_splat_operators, add_render_operators, add_body_operators, add_optim_operators})
    add(names);
  return names;
}

}  // namespace hsi4d
