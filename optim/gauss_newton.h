// Gauss–Newton steps with damping, for few numbers: the curvature comes from products, not from how gradients changed.
//
//   z = x/lr,   B = Jᵀ ∇²φ J,   (B + λ I) d = −g,   z ← z + d                  J of the loss's inputs y, ∇²φ of the
//   loss
//
// [Levenberg 1944, Marquardt 1963; B as Schraudolph 2002 has it: JᵀWJ where the loss is a weighted sum of squares]. A
// product B p is an evaluation at z + h p in which the loss's inputs are seams that tell of the change
// (autodiff/seam.h). The equations are solved in the space of a few orthonormal directions P,
//
//   (PᵀBP + λ I) c = −Pᵀg,   d = P c,   the next direction: M (−g − (B + λ I) d), made orthogonal to those before,
//
// which are conjugate gradients that keep their directions: damping a step more that was too long costs no product, and
// products need not be exact. M ≈ B⁻¹ is what the products have told so far (update_inverse_hessian), from steps and
// frames before too [Morales and Nocedal 2000: preconditioning by quasi-Newton updates of conjugate gradients'
// products]. No further direction is asked for where the last one, of k, gave less than half a k-th of what the
// quadratic model falls by in all [Nash and Sofer 1990].
//
// λ follows the gain ratio ρ, of the loss's fall and the model's [Nielsen 1999, Damping parameter in Marquardt's
// method]: λ ← λ max(1/3, 1 − (2ρ − 1)³) for a step that makes the loss smaller, else λ ← ν λ, ν ← 2 ν.
//
// Everything but the evaluations is computed in double. An evaluation is an iteration: a step takes one for each
// product and one to see what it brought.
#pragma once

#include "autodiff/seam.h"
#include "optim/unit_numbers.h"

namespace hsi4d {

/// No number goes further in one step than this many times its group's learning rate.
inline constexpr double kLongestGaussNewtonStep = 10;

/// The optimiser of one stage. Steps are bitwise the same for any number of threads, and allocate nothing after the
/// first. Learning rates are the units in which numbers of different kinds compare; the schedule (from, until, every,
/// lr_final_share) has no meaning here.
///
/// A bad evaluation, as Adam has it, is a step that was too long.
template <class S>
class GaussNewton {
 public:
  /// @param groups    as UnitNumbers has them, with the same errors
  /// @param products  at most so many in a step
  /// @param seams     the mode of the seams through which alone the loss depends on the groups. It is changed to what
  ///                  the next evaluation has to tell.
  GaussNewton(Tape<S>& tape, std::vector<OptimizerGroup<S>> groups, Index products, SeamMode& seams);
  GaussNewton(const GaussNewton&) = delete;
  GaussNewton& operator=(const GaussNewton&) = delete;
  ~GaussNewton() { seams_ = {}; }

  /// Takes in the evaluation that was just made and moves the numbers to where the next one is wanted; in the last
  /// iteration, or where nothing is left to gain, to the best that were evaluated.
  StepReport step(Index iteration, Index iterations, double loss);

  /// Begins with what another stage over the same numbers has learnt as M; to be called before the first step.
  /// @param inverse_hessian  as curvature() gave it; passed over where it is of another number of numbers
  void set_curvature(const std::vector<double>& inverse_hessian);
  /// M in units of the learning rates, all of it, the largest number of its diagonal 1; empty where nothing was learnt.
  std::vector<double> curvature() const { return is_learnt_ ? whole_of(inverse_) : std::vector<double>(); }

  /// No further evaluation is wanted: the next step would move no number by a fiftieth of its learning rate, or make
  /// the loss smaller by a millionth at most.
  bool is_done() const { return done_; }
  Index rollbacks() const { return rollbacks_; }

 private:
  using VectorX = Eigen::VectorXd;
  using MatrixX = Eigen::MatrixXd;

  void accept(double loss);
  void damp_more();
  void add_product();
  void learn(const VectorX& direction, const VectorX& product);
  void solve();
  bool is_solved() const;
  bool find_direction();
  void ask_for_product();
  void ask_for_step();

  UnitNumbers<S> numbers_;
  SeamMode& seams_;
  Index most_products_ = 0;
  VectorX trial_, trial_gradient_;  // where the evaluation is, in units; and its gradient, or its product
  VectorX point_, gradient_;        // the best so far
  MatrixX directions_, products_;   // P and B P: the first count_ columns
  MatrixX reduced_;                 // PᵀBP; beyond count_ of no meaning
  MatrixX factor_;                  // of its damped form
  VectorX weights_;                 // c
  VectorX step_;                    // d
  VectorX residual_, next_;         // −g − (B + λ I) d; the direction whose product is asked for
  MatrixX inverse_;                 // M, its lower half
  bool is_learnt_ = false;
  Index count_ = 0;
  double loss_ = 0, gain_ = 0,
         gain_before_ = 0;           // at the point; by which the model falls, with count_ directions and less
  double damping_ = 0, growth_ = 2;  // λ, 0: not known yet; ν
  double used_damping_ = 0;          // λ, or more, where the step would have been too long or uphill
  double probe_;                     // the largest number of h p
  bool is_product_ = false;          // the evaluation is one
  bool is_refused_ = false;          // the last step: its products are all that there are
  Index steps_ = 0, rollbacks_ = 0;  // steps: accepted, the start among them
  bool done_ = false;
};

extern template class GaussNewton<float>;
extern template class GaussNewton<double>;

/// How far one number of a group can get in a stage.
double longest_gauss_newton_way(const ParameterGroupSettings& settings, Index iterations);

}  // namespace hsi4d
