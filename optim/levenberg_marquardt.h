// Levenberg-Marquardt: steps by a Gauss-Newton matrix, in a region that grows and shrinks by what they gained.
//
//   z = x/lr,   (σH + λ diag(σH)) d = −g,   predicted = −gᵀd − ½ σ dᵀHd,   ρ = (loss(z) − loss(z + d)) / predicted
//
// [Nocedal and Wright 2006, chapter 10; the damping by Nielsen 1999, "Damping parameter in Marquardt's method": after a
// step with ρ > 0 λ ← λ max(1/3, 1 − (2ρ − 1)³), after another λ ← νλ, ν ← 2ν, and the step is taken back.] H has the
// weights of iteratively reweighted least squares, which touch |r| from above: along a long step the loss curves less
// than H says. σ ≤ 1 is how much less: the root of its product with 2 (−gᵀd − gain)/dᵀHd after each step that was
// taken. A number that would go too far is damped more, by itself. Everything is computed in double. One evaluation of
// the loss is one iteration, so a step that is taken back costs one.
//
// Groups of many numbers (nets) are moved by Adam together with a step, in iterations in which they are on; where that
// step is taken back, theirs is too.
#pragma once

#include <optional>

#include "optim/unit_curvature.h"

namespace hsi4d {

/// No number goes further in one step than this many times its group's learning rate.
inline constexpr double kLongestMatrixStep = 10;

/// The optimiser of one stage. Steps are bitwise the same for any number of threads. Learning rates are the units in
/// which numbers of different kinds compare; `lr_final_share` has no meaning for groups in the matrix. Numbers of
/// groups that are off, and those that are at an end of their range and are pushed beyond it, stand still for a step.
///
/// A bad evaluation, as Adam has it, is a step that is taken back, after which λ grows tenfold. A number that the
/// matrix does not see moves by its gradient, at most kLongestMatrixStep. A matrix that is not finite is replaced by
/// the last one, the first by the lengths of the gradients. What no damping makes positive ends the stage.
template <class S>
class LevenbergMarquardt {
 public:
  /// @param loss  of the stage, on the tape
  /// Throws UserError as UnitNumbers, and where no group is small enough for a matrix.
  LevenbergMarquardt(Tape<S>& tape, Var<S> loss, const std::vector<OptimizerGroup<S>>& groups,
                     const OptimizerSettings& settings);
  LevenbergMarquardt(const LevenbergMarquardt&) = delete;
  LevenbergMarquardt& operator=(const LevenbergMarquardt&) = delete;

  /// Moves the numbers to where the next evaluation is wanted, by the tape's last backward run of the loss; in the last
  /// iteration, or where nothing is left to gain, to the best that were evaluated.
  StepReport step(Index iteration, Index iterations, double loss);

  /// No further evaluation is wanted: the next step would move no number by a fiftieth of its learning rate.
  bool is_done() const { return done_; }
  Index rollbacks() const { return rollbacks_; }
  /// What moves groups of many numbers.
  Adam<S>& beside() { return beside_; }
  const Adam<S>& beside() const { return beside_; }
  bool is_beside(std::string_view group) const;

 private:
  using VectorX = Eigen::VectorXd;

  void judge(bool is_bad, double loss);
  void accept(double loss);
  void refuse(bool is_bad);
  void make_matrix();
  void move_beside(Index iteration, Index iterations, double loss, StepReport& report);
  void choose_step();
  bool solve();
  bool solve_damped();
  bool damp_long_numbers();
  bool is_held(Index i) const;

  Tape<S>& tape_;
  Var<S> loss_var_;
  OptimizerSettings settings_;
  std::vector<OptimizerGroup<S>> all_;
  std::vector<std::string> many_;  // names of groups that Adam moves
  UnitNumbers<S> numbers_;
  UnitCurvature<S> curvature_;
  Adam<S> beside_;
  std::vector<GroupStep> reports_;
  VectorX trial_, trial_gradient_;              // where the loss was just evaluated; and the gradient by these
  VectorX point_, gradient_, step_;             // the best so far; from there to the trial
  Eigen::MatrixXd matrix_, undamped_, damped_;  // H at the point; σH + λ diag(σH); and own damping
  VectorX own_damping_;                         // of numbers that went too far
  Eigen::LLT<Eigen::MatrixXd> factored_;
  double loss_ = 0, predicted_ = 0;
  double slope_ = 0, bend_ = 0;  // gᵀd, dᵀHd of the step
  double damping_, growth_ = 2, stiffness_ = 1;
  std::optional<double> gain_ratio_;
  bool refused_ = false, done_ = false, moved_beside_ = false;
  Index accepted_ = 0, rollbacks_ = 0;  // accepted: the start among them
  Index small_steps_ = 0;               // in a row
};

extern template class LevenbergMarquardt<float>;
extern template class LevenbergMarquardt<double>;

/// How far one number of a group can get in a stage.
double longest_matrix_way(const ParameterGroupSettings& settings, Index iterations);

}  // namespace hsi4d
