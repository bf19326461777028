// `hsi4d gradcheck`: the gradient of one stage of a config, on the config's own data.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "optim/loss_term.h"
#include "optim/stage_gradcheck.h"
#include "pipelines/config/run_config.h"

namespace hsi4d {

/// What is looked at, and how closely.
struct StageCheckOptions {
  std::string stage;
  /// Of a stage over frames; none: the first that has all the frames before it that terms over the motion see.
  std::optional<Index> frame;
  Index entries = 8;  ///< tried of each array
  std::uint64_t seed = 1;
  int threads = 0;  ///< 0: what the config says
};

/// What was found, and where.
struct StageCheck {
  std::string stage;
  std::optional<Index> frame;  ///< none: a stage over the sequence
  double tolerance = 0;
  StageGradcheck found;
};

/// Checks a stage where it would begin if all stages before it had left things as they were given: frames as estimated,
/// or as frame 0, but for the disturbance (optim/stage_gradcheck.h). Gradients that
/// color_net.camera_gradient stops on purpose are let through.
///
/// Throws UserError for a stage or a frame that is not there, for a chain, and where a program of `sources` would have
/// to be run first; as a run for its inputs; as check_stage_gradient.
StageCheck check_stage(const RunConfig& config, const std::vector<LossTerm>& losses, const StageCheckOptions& options);

}  // namespace hsi4d
