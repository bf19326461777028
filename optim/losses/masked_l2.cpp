// L = mean over all pixels and colours of weight · (rendered − target)².   [method, stage 1: the camera's loss]
#include "autodiff/difference.h"
#include "optim/losses/list.h"

namespace hsi4d {

LossTerm masked_l2_loss() {
  return needing(
      {LossInput::kImage},
      make_loss_term("masked_l2", "Squared difference of the rendered image and the frame where the weight says so",
                     [](const auto& in) {
                       return in.given(in.weight) ? l2(in.rendered, in.target, in.weight) : l2(in.rendered, in.target);
                     }));
}

}  // namespace hsi4d
