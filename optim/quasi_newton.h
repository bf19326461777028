// BFGS with a line search, for few numbers: what a camera needs is found in a fifth of Adam's evaluations.
//
//   z = x/lr,   d = −H g,   z ← z + t d                                 t = 1, shortened until the loss falls enough
//   s = z' − z,  y = g' − g,   H ← (I − s yᵀ/sᵀy) H (I − y sᵀ/sᵀy) + s sᵀ/sᵀy                  where sᵀy > 0
//
// [Nocedal and Wright 2006, Numerical Optimization, algorithm 6.1; the first H is the identity, or what a stage like
// this has learnt before, scaled so that no number goes further than its learning rate, and after the first step (6.20)
// by sᵀy/yᵀHy; a step is taken that meets Armijo's condition (3.4), else shortened by the parabola through what is
// known (3.57), to a tenth at least.] Everything is computed in double. One evaluation of the loss is one iteration, so
// a step that was too long costs one.
#pragma once

#include "optim/unit_numbers.h"

namespace hsi4d {

/// No number goes further in one step than this many times its group's learning rate.
inline constexpr double kLongestQuasiNewtonStep = 10;

/// The optimiser of one stage. Steps are bitwise the same for any number of threads, and allocate nothing after the
/// first two. Learning rates are the units in which numbers of different kinds compare and the length of the first
/// step; the schedule (from, until, every, lr_final_share) has no meaning here.
///
/// A bad evaluation, as Adam has it, is a step that was too long.
template <class S>
class QuasiNewton {
 public:
  /// @param groups  as UnitNumbers has them, with the same errors
  QuasiNewton(Tape<S>& tape, std::vector<OptimizerGroup<S>> groups);
  QuasiNewton(const QuasiNewton&) = delete;
  QuasiNewton& operator=(const QuasiNewton&) = delete;

  /// Moves the numbers to where the next evaluation is wanted, by the gradients of the tape's last backward; in the
  /// last iteration, or where nothing is left to gain, to the best that were evaluated.
  StepReport step(Index iteration, Index iterations, double loss);

  /// Begins with what another stage over the same numbers has learnt in the place of the identity; to be called before
  /// the first step. @param inverse_hessian  as curvature() gave it; passed over where it is of another number of
  /// numbers
  void set_curvature(const std::vector<double>& inverse_hessian);
  /// H in units of the learning rates, all of it, the largest number of its diagonal 1; empty where nothing was learnt.
  std::vector<double> curvature() const;

  /// No further evaluation is wanted: the next step, as the one before it, would move no number by a fiftieth of its
  /// learning rate, or no step along the last direction makes the loss smaller.
  bool is_done() const { return done_; }
  Index rollbacks() const { return rollbacks_; }

 private:
  using VectorX = Eigen::VectorXd;

  void accept(double loss);
  void scale_first(const VectorX& y, double curvature);
  void choose_direction();
  void shorten(double loss);

  UnitNumbers<S> numbers_;
  VectorX trial_, trial_gradient_;        // where the loss was just evaluated, in units; and the gradient by these
  VectorX point_, gradient_, direction_;  // the best so far
  VectorX moved_, change_, product_;      // s, y, H y
  Eigen::MatrixXd first_;                 // H before it has learnt anything, but for its scale
  Eigen::MatrixXd inverse_hessian_;       // H, its lower half
  bool is_learnt_ = false;                // H has seen how the gradient changed
  double loss_ = 0, slope_ = 0, length_ = 1;
  Index steps_ = 0, rollbacks_ = 0;  // steps: accepted, the start among them
  Index small_steps_ = 0;            // in a row
  bool done_ = false;
};

extern template class QuasiNewton<float>;
extern template class QuasiNewton<double>;

/// How far one number of a group can get in a stage.
double longest_quasi_newton_way(const ParameterGroupSettings& settings, Index iterations);

}  // namespace hsi4d
