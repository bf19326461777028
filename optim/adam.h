// Adam, with steps that are taken back when a number is not finite.
//
//   m ← β1 m + (1 − β1) g,   v ← β2 v + (1 − β2) g²
//   x ← x − lr · m̂ / (√v̂ + ε),   m̂ = m / (1 − β1ᵗ),   v̂ = v / (1 − β2ᵗ)
//
// [Kingma and Ba 2015, algorithm 1; ε is added to the root of the corrected v̂, as in PyTorch: row F2 of the stability
// catalogue]. t counts the steps of each group for itself. 1 − βᵗ is −expm1(t log β) (row F3). Everything is computed
// in double, from gradients and into parameters of the tape's precision; the moments are kept in double, so that the
// square of a gradient of 1e-23 is not lost. Since v̂ has the square of the loss's scale and ε has not, ε says below
// which gradients steps become small; scaling a loss by c and ε by c gives the same steps.
#pragma once

#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "optim/parameters.h"
#include "optim/stage_settings.h"

namespace hsi4d {

/// Gradients of a larger magnitude count as not finite (row F1): a step with such a one would make v so large that the
/// parameter stands still for tens of thousands of iterations.
inline constexpr double kLargestGradient = 1e18;

/// What a good step makes of the factor of all rates after bad ones: 2^(1/8), so that eight make up for a bad one.
inline constexpr double kRateRecovery = 1.0905077326652577;

/// What a group has accumulated. Without blocks: nothing yet.
struct GroupMoments {
  struct Block {
    std::vector<double> mean;    ///< m, a number for each of the parameter's, row-major without padding
    std::vector<double> square;  ///< v
    bool operator==(const Block&) const = default;
  };
  Index steps = 0;  ///< t
  std::vector<Block> blocks;
  bool operator==(const GroupMoments&) const = default;
};

/// The moments of several groups, by name.
using AdamState = std::map<std::string, GroupMoments, std::less<>>;

/// A parameter group and how it moves.
template <class S>
struct OptimizerGroup {
  ParameterGroup<S> parameters;
  ParameterGroupSettings settings;
};

/// The first number that forbade a step.
struct BadNumber {
  std::string group;  ///< empty: the loss itself
  std::string block;  ///< the array's name on the tape
  Index plane = 0, row = 0, col = 0;
  double value = 0;

  /// "the gradient of group 'body', array 'pose', row 3, column 1 is nan", or "the loss is inf".
  std::string text() const;
};

/// What a step did to one group.
struct GroupStep {
  std::string_view name;
  bool moved = false;
  double learning_rate = 0;  ///< that of this iteration; 0 when the group is off
  double gradient_norm = 0;  ///< Euclidean norm over all its blocks; 0 when the group is off
};

/// What a method with a matrix tells of a step.
struct MatrixStep {
  std::optional<double> gain_ratio;  ///< lm: how much smaller the last step made the loss, of what the matrix said
  double damping = 0;                ///< of the step that begins
  double condition = 0;              ///< of its matrix, an estimate in the 1-norm; infinite where it has none
  bool refused = false;              ///< lm: the last step made the loss no smaller, and was taken back
};

/// What a step did. Views are good until the next step.
struct StepReport {
  bool rolled_back = false;      ///< no step: a number was not finite
  bool undone = false;           ///< and the step before it was taken back; false where there was none
  std::optional<BadNumber> bad;  ///< when rolled_back
  Index rollbacks = 0;           ///< so far
  std::span<const GroupStep> groups;
  std::optional<MatrixStep> matrix = {};
};

/// Whether a group moves in an iteration: from, from + every, …, before until.
bool moves_in(const ParameterGroupSettings& settings, Index iteration);

/// Learning rate of iteration i of n: lr · share^(i/(n − 1)).
double scheduled_rate(const ParameterGroupSettings& settings, Index iteration, Index iterations);

/// How far one number of a group can get in a stage, whatever the gradients are: Σ lr_i |m̂/√v̂| at most, by
/// Cauchy-Schwarz over the weights of the past gradients in m and v.
double longest_adam_way(const ParameterGroupSettings& settings, Index iterations, const OptimizerSettings& optimizer);

/// 1 − βᵗ without cancellation, β in [0, 1), t ≥ 1 (row F3).
double bias_correction(double beta, Index steps);

/// The optimiser of one stage. Steps are bitwise the same for any number of threads and allocate nothing.
///
/// A bad evaluation (a loss that is not finite, or a gradient of a moving group that is not or is beyond
/// kLargestGradient) is the fault of the step that led there (rows D4, F1): that step is taken back, bitwise, moments
/// included, and the learning rates of all groups are halved. Without a step to take back nothing moves. Eight good
/// steps make up for one bad one. Denormal gradients count as zero, moments never become denormal (row F4: denormals).
template <class S>
class Adam {
 public:
  /// @param groups  leaves of `tape`, none of them twice. Throws InternalError otherwise.
  Adam(Tape<S>& tape, std::vector<OptimizerGroup<S>> groups, const OptimizerSettings& settings);
  Adam(const Adam&) = delete;
  Adam& operator=(const Adam&) = delete;

  /// Moves the groups that are on in `iteration` by the gradients of the tape's last backward. A block without a
  /// gradient (frozen, or the loss does not depend on it) stays.
  ///
  /// @param iteration   from 0
  /// @param iterations  of the stage, for the schedule
  /// @param loss        value of the evaluation
  StepReport step(Index iteration, Index iterations, double loss);

  /// Takes the last step back: parameters, moments, step counts. False when there is none, or it was taken back before.
  bool undo();

  Index rollbacks() const { return rollbacks_; }
  /// Factor of all learning rates, at most 1.
  double rate() const { return rate_; }
  /// Bad evaluations since the last good one.
  Index bad_in_a_row() const { return bad_in_a_row_; }

  /// The moments of a group. Throws InternalError for an unknown name.
  GroupMoments moments(std::string_view group) const;
  /// Goes on from moments that were read before; undo has nothing to take back then. Throws InternalError for an
  /// unknown name, DataError naming the group when the sizes are of other parameters.
  void set_moments(std::string_view group, const GroupMoments& moments);
  /// Forgets the mean gradient of one row of a block, whose numbers were given another meaning since the last step: the
  /// next steps are shorter, not longer, for the mean square stays. The last step can still be taken back, to the
  /// numbers and moments from before it.
  void clear_mean(Var<S> block, Index row);

 private:
  struct Block {
    Var<S> var;
    std::vector<double> mean, square;              // m, v
    std::vector<double> other_mean, other_square;  // where the next step writes them; afterwards those before it
    std::vector<S> before;                         // the parameter before the last step
    bool moved = false;                            // in the last step
  };
  struct Group {
    std::string name;
    ParameterGroupSettings settings;
    std::vector<Block> blocks;
    Index steps = 0;
    bool moved = false;  // in the last step
  };

  Group& group_named(std::string_view name);
  std::optional<BadNumber> look_for_bad_numbers(Index iteration, double loss);
  std::optional<BadNumber> first_bad(const Group& group, const Block& block) const;
  void move(Group& group, double learning_rate);
  void move(Block& block, double step, double root_scale);

  Tape<S>& tape_;
  OptimizerSettings settings_;
  std::vector<Group> groups_;
  std::vector<GroupStep> reports_;
  double rate_ = 1;
  Index rollbacks_ = 0, bad_in_a_row_ = 0;
  bool can_undo_ = false;
};

extern template class Adam<float>;
extern template class Adam<double>;

}  // namespace hsi4d
