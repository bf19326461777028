// L = ‖z‖², z the latents of the body's pose: how unlikely the pose is.   [body/pose_prior.h]
#include "body/pose_prior.h"

#include <filesystem>

#include "optim/losses/list.h"

namespace hsi4d {

namespace {

/// The energy of a likely pose is about the number of latents, the photometric loss a few hundredths:
/// docs/numerics/body.md.
constexpr double kWeight = 3e-5;

struct PosePriorSettings {
  std::filesystem::path weights;
};

void describe(ConfigFields& fields, PosePriorSettings& settings) {
  fields.path("weights", settings.weights, {.must_exist = true},
              "VPoser's weights (tools/export_vposer.py); empty: natural poses by anatomy");
}

}  // namespace

LossTerm pose_prior_loss() {
  LossTerm term = needing(
      {LossInput::kPose},
      make_loss_term<PosePriorSettings>(
          "pose_prior", "How unlikely the body's pose is",
          [](const PosePriorSettings& settings) { return read_pose_prior(settings.weights.string()); },
          [](const auto& in, const PosePrior& prior) { return prior.energy(prior.encode(in.body_rotations)); }));
  term.description.weight = kWeight;
  return term;
}

}  // namespace hsi4d
