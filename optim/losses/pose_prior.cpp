// L = ‖z‖², z the latents of the body's pose: how unlikely the pose is.   [body/pose_prior.h]
#include "body/pose_prior.h"

#include <filesystem>

#include "optim/losses/list.h"

namespace hsi4d {

namespace {

struct PosePriorSettings {
  std::filesystem::path weights;
};

void describe(ConfigFields& fields, PosePriorSettings& settings) {
  fields.path("weights", settings.weights, {.must_exist = true},
              "VPoser's weights (tools/export_vposer.py); without, natural poses by anatomy");
}

}  // namespace

LossTerm pose_prior_loss() {
  return make_loss_term<PosePriorSettings>("pose_prior", "How unlikely the body's pose is",
                                           [](const auto& in, const PosePriorSettings& settings) {
                                             if (!in.given(in.body_rotations)) return decltype(in.body_rotations){};
                                             const PosePrior prior = read_pose_prior(settings.weights.string());
                                             return prior.energy(prior.encode(in.body_rotations));
                                           });
}

}  // namespace hsi4d
