// L = mean over objects of (d̂ − d)²: an object's mean camera depth stays what it was, metres.   [method, stage 2]
#include "autodiff/difference.h"
#include "optim/losses/list.h"

namespace hsi4d {

LossTerm depth_loss() {
  LossTerm term = make_loss_term(
      "depth", "Difference of each object's mean depth and that of the clip's first frame", [](const auto& in) {
        const bool given =
            in.given(in.object_depth) && in.given(in.object_depth_target) && in.object_depth.shape().rows > 0;
        return given ? l2(in.object_depth, in.object_depth_target) : decltype(in.object_depth){};
      });
  term.description.needs = LossNeeds::kObjects;
  return term;
}

}  // namespace hsi4d
