// Mean opacity of the Gaussians: what a scene can do without fades, and goes where it is needed. [Kheradmand et al.
// 2024]
#include "autodiff/reduce.h"
#include "optim/losses/list.h"

namespace hsi4d {

LossTerm gaussian_opacity_loss() {
  return needing({LossInput::kGaussians},
                 make_loss_term("gaussian_opacity", "Mean opacity of the Gaussians that a reconstruction makes",
                                [](const auto& in) { return mean(in.gaussian_opacities); }));
}

}  // namespace hsi4d
