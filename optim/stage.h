// Runs one stage: makes a weighted sum of loss terms small by moving groups of parameters, as the stage's settings say.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "autodiff/curvature.h"
#include "optim/adam.h"
#include "optim/gradient_shares.h"
#include "optim/loss_term.h"
#include "optim/parameters.h"
#include "optim/stage_settings.h"

namespace hsi4d {

/// One term of a stage's loss.
struct LossValue {
  std::string name;
  double weight = 1;
  double value = 0;  ///< without the weight
};

/// One iteration, as a callback sees it. Views are good during the call.
struct IterationReport {
  Index iteration = 0;               ///< from 0
  Index iterations = 0;              ///< of the stage
  double loss = 0;                   ///< weighted sum, before this iteration's step
  std::span<const LossValue> terms;  ///< in the order of the settings
  std::span<const GroupStep> groups;
  bool rolled_back = false;                             ///< nothing moved in this iteration: a number was not finite
  Index rollbacks = 0;                                  ///< so far
  std::string_view offender;                            ///< when rolled_back: the first number that was not finite
  double seconds = 0;                                   ///< of this iteration
  TapeCounters tape = {};                               ///< of this iteration
  std::span<const GradientShare> gradient_shares = {};  ///< where the settings ask for them; empty in a bad evaluation
  std::optional<MatrixStep> matrix = {};                ///< with lm and whitened_adam
};

/// Called after every iteration. May throw to end the stage: the parameters then stay as they are.
using StageCallback = std::function<void(const IterationReport&)>;

/// An object, or the human, that a term left out in some evaluations of a stage, as LeftOut has it.
struct LeftOutObject {
  std::string term, reason;
  Index object = 0;
  Index evaluations = 0;  ///< of iterations + 1
  bool of_human = false;
};

/// Where the time of a stage went, seconds.
struct StageTimes {
  double forward = 0;   ///< of the tape, freezing and holding included
  double backward = 0;  ///< of the tape, shares of terms included
  double step = 0;      ///< looking at every number, moving the parameters
};

/// What one Gauss-Newton matrix of a stage would take.
struct CurvatureCost {
  CurvatureTimes times;
  Index numbers = 0;  ///< its rows
  Index movers = 0;
};

/// What a stage has done.
struct StageResult {
  Index iterations = 0;
  double loss = 0;               ///< of the parameters as they are now
  std::vector<LossValue> terms;  ///< of the parameters as they are now
  std::vector<std::string> off;  ///< terms of the settings that lacked an input, or have weight 0
  Index rollbacks = 0;
  double seconds = 0;
  StageTimes times;
  std::vector<LeftOutObject> left_out;     ///< by term and object, in order
  std::vector<LossNote> notes;             ///< in the order of the terms
  std::vector<NodeStatistics> nodes;       ///< of the tape, losses included, with StageOptions::profile
  std::optional<CurvatureCost> curvature;  ///< with time_curvature; none where a render moves in another way
};

/// An operator's output that follows its inputs in iterations in which one of the groups moves, and is held in all
/// others (Tape::hold), as it is when the stage begins or after such a step.
struct HeldOutput {
  std::uint32_t id = 0;  ///< of its Var
  std::vector<std::string> groups;
};

/// What the settings do not say.
struct StageOptions {
  std::string name = "stage";  ///< what messages call it
  /// Groups named here go on from these moments (none yet: an entry without blocks), and leave theirs here at the end.
  /// All others start afresh.
  AdamState* kept = nullptr;
  /// bfgs and whitened_adam go on from this curvature (none yet: empty), and leave there what they have learnt. Null:
  /// they start afresh.
  std::vector<double>* curvature = nullptr;
  bool profile = false;         ///< measure the time of every node
  bool time_curvature = false;  ///< measure one more evaluation and its curvature where the stage ends
  std::vector<HeldOutput> held = {};
};

/// A stage was given up: more evaluations than max_rollbacks were not finite, with Adam in a row. Not a bug: the
/// message says which numbers.
class StageDivergedError : public UserError {
 public:
  using UserError::UserError;
};

/// Throws UserError that tells, a line each, which groups of settings.optimize are not among `names` (with the nearest
/// known name), or that none is named. `where` begins each line: "run.json: /stages/camera/optimize".
void check_groups(const StageSettings& settings, const std::vector<std::string>& names, const std::string& where);

/// Runs a stage.
///
/// Records Σ weight · term at the end of the tape, and in each iteration: lets gradients flow to the groups that are on
/// in it and to no other of `available` (what is frozen costs nothing), runs the tape forward and backward, and takes
/// a step of the optimiser (optim/optimizer.h). Where settings.gradient_shares asks, it runs backward for each term by
/// itself before that, which changes no result. Rows of groups that are axis-angles are wrapped after each step.
/// Numbers of named groups that have a range are held in it, after each step and before the first evaluation. A last
/// forward run evaluates the parameters that are left; should they give a loss that is not finite, the last step is
/// taken back. At the end (also by an exception) what was recorded is forgotten, `available` is frozen or not as
/// before, and nothing is held.
///
/// @param tape       holds the inputs and the parameters
/// @param settings   what moves and which terms count; a term without settings of its own takes its defaults
/// @param terms      the terms that settings may name
/// @param inputs     what the terms read; a term that needs what is not given is off
/// @param available  groups that settings may name. A parameter of this list that is in no named group does not move.
/// @param callback   may be empty. Must not record on the tape.
/// Throws UserError naming the stage: an unknown group or term, no group, no term that gives anything, two named groups
/// that share a parameter, a group that no term depends on; StageDivergedError. What the tape throws passes through.
template <class S>
StageResult run_stage(Tape<S>& tape, const StageSettings& settings, std::span<const LossTerm> terms,
                      const LossInputs<S>& inputs, const std::vector<ParameterGroup<S>>& available,
                      const StageCallback& callback = {}, const StageOptions& options = {});

extern template StageResult run_stage(Tape<float>&, const StageSettings&, std::span<const LossTerm>,
                                      const LossInputs<float>&, const std::vector<ParameterGroup<float>>&,
                                      const StageCallback&, const StageOptions&);
extern template StageResult run_stage(Tape<double>&, const StageSettings&, std::span<const LossTerm>,
                                      const LossInputs<double>&, const std::vector<ParameterGroup<double>>&,
                                      const StageCallback&, const StageOptions&);

}  // namespace hsi4d
