// L = Σ over the body's joints of how far they are beyond their ranges, radians².   [body/natural_pose.h]
#include "body/pose_prior.h"
#include "optim/losses/list.h"

namespace hsi4d {

namespace {

constexpr double kLimitWeight = 0.01;  // from 0.001 to 1 as good (docs/numerics/body.md)

}  // namespace

LossTerm joint_limits_loss() {
  LossTerm term =
      needing({LossInput::kPose}, make_loss_term("joint_limits", "How far the body's joints are beyond their ranges",
                                                 [](const auto& in) { return joint_limit_energy(in.body_rotations); }));
  term.description.weight = kLimitWeight;
  return term;
}

}  // namespace hsi4d
