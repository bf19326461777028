// L = mean over the frames that move of Σ_j |Ĵ_j − J_j|²: the first 22 joints stay where the stage found them, m².
// [method, stage 3: Eq. 15]
#include "autodiff/difference.h"
#include "autodiff/elementwise.h"
#include "optim/losses/list.h"

namespace hsi4d {

LossTerm fit_loss() {
  return needing({LossInput::kMotion},
                 make_loss_term("fit", "How far the joints are from where the stage found them", [](const auto& in) {
                   // Frames that stand still add nothing to the sum.
                   const double frames = static_cast<double>(in.motion->moving_frames());
                   return l2(in.joints, in.joints_start) * (static_cast<double>(in.joints.shape().count()) / frames);
                 }));
}

}  // namespace hsi4d
