// Checks the gradient of a stage: its whole weighted loss by every group that it moves, against central differences.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "autodiff/gradcheck.h"
#include "optim/stage.h"

namespace hsi4d {

/// What was found of one group. Without entries: there is nothing to move.
struct GroupGradcheck {
  std::string group;
  Index numbers = 0;  ///< that the group has
  GradcheckReport report;
};

/// What was found of a stage, at the parameters where it was looked at.
struct StageGradcheck {
  double loss = 0;
  std::vector<LossValue> terms;
  std::vector<std::string> off;        ///< terms of the settings that lacked an input, or have weight 0
  std::vector<GroupGradcheck> groups;  ///< in the settings' order

  /// Whether some group was tried, and each that has numbers passed.
  bool ok() const;
};

/// How a stage's gradient is looked at.
struct StageGradcheckOptions {
  /// A step that reorders Gaussians, or takes one to a further pixel, says nothing of the gradient: shorter ones are
  /// then tried. What rounding leaves of a difference by the shortest is within the tolerance.
  GradcheckOptions differences = {
      .tolerance = 1e-4, .step = 1e-4, .shortest_step = 5e-9, .entries = 8, .kink_share = 0.5, .each_node = false};
  /// Every number of the groups is moved by a random amount up to this first: metres, radians, or of a matrix. Where a
  /// stage begins, terms about what has changed since have no slope.
  double disturbance = 0.01;
};

/// Records the loss as run_stage does, and looks at each group of the settings by itself, the others frozen, whichever
/// iterations it moves in. Outputs of stop_gradient are held meanwhile: what moves through them is left out of the
/// gradient on purpose, and of the differences alike. Nothing else is held. At the end (also by an exception) what was
/// recorded is forgotten; the disturbance stays in the parameters.
///
/// @param stage  what messages call it
/// Throws UserError as run_stage: an unknown group or term, no group, no term that gives anything, two groups that
/// share a parameter, a group that no term depends on; a loss that is not finite.
StageGradcheck check_stage_gradient(Tape<double>& tape, const StageSettings& settings, std::span<const LossTerm> terms,
                                    const LossInputs<double>& inputs,
                                    const std::vector<ParameterGroup<double>>& available, const std::string& stage,
                                    const StageGradcheckOptions& options = {});

}  // namespace hsi4d
