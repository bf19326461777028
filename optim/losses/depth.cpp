// L = mean over objects of (d̂ − d)²: an object's mean camera depth stays what it was, metres.   [method, stage 2]
#include "autodiff/difference.h"
#include "optim/losses/list.h"

namespace hsi4d {

LossTerm depth_loss() {
  return needing({LossInput::kObjectDepth},
                 make_loss_term("depth", "Difference of each object's mean depth and that of the clip's first frame",
                                [](const auto& in) { return l2(in.object_depth, in.object_depth_target); }));
}

}  // namespace hsi4d
