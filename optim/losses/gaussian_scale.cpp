// Mean size of the Gaussians, metres: what is larger than the pictures ask for shrinks. [Kheradmand et al. 2024, eq.
// 12]
#include "autodiff/elementwise.h"
#include "autodiff/reduce.h"
#include "optim/losses/list.h"

namespace hsi4d {

LossTerm gaussian_scale_loss() {
  return needing({LossInput::kGaussians},
                 make_loss_term("gaussian_scale", "Mean scale of the Gaussians that a reconstruction makes, metres",
                                [](const auto& in) { return mean(exp(in.gaussian_log_scales)); }));
}

}  // namespace hsi4d
