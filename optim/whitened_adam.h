// Adam in numbers that are not correlated: what of the pose looks alike in the image is moved together.
//
//   A = (D^−½ H D^−½ + λ I)/(1 + λ) = L Lᵀ,   D = diag H,   z = Lᵀ x/lr
//
// with H the Gauss-Newton matrix (autodiff/curvature.h), and Adam's step in z. Where H is diagonal this is Adam: its
// steps have the length of the learning rates whatever the scales of H are. λ, `damping`, says how much longer a step
// may be in a direction that the image hardly tells, √((1 + λ)/λ) times. A new matrix turns the moments along: those of
// M z with M = L'⁻¹ L are M m and (M ∘ M) v.
//
// Groups of many numbers (nets) are moved by Adam itself.
#pragma once

#include "optim/unit_curvature.h"

namespace hsi4d {

/// The optimiser of one stage. Steps are bitwise the same for any number of threads.
///
/// Numbers keep to UnitNumbers' low and high. Bad evaluations, and the learning rates after them, are as Adam has them.
/// A number that the matrix does not see is correlated with none. A matrix that is not finite is passed over.
template <class S>
class WhitenedAdam {
 public:
  /// @param loss  of the stage, on the tape
  /// Throws UserError as UnitNumbers, and where no group is small enough for a matrix.
  WhitenedAdam(Tape<S>& tape, Var<S> loss, const std::vector<OptimizerGroup<S>>& groups,
               const OptimizerSettings& settings);
  WhitenedAdam(const WhitenedAdam&) = delete;
  WhitenedAdam& operator=(const WhitenedAdam&) = delete;

  /// As Adam::step. A matrix is made in the first iteration, unless set_curvature gave one, and in every
  /// matrix_every-th.
  StepReport step(Index iteration, Index iterations, double loss);
  /// As Adam::undo.
  bool undo();

  /// Begins with the matrix of another stage over the same numbers; passed over where it is of another number of
  /// numbers, or not positive. @param correlations  as curvature() gave them
  void set_curvature(const std::vector<double>& correlations);
  /// A of the last matrix; empty where there was none.
  std::vector<double> curvature() const;

  Index rollbacks() const { return rollbacks_; }
  /// Bad evaluations since the last good one.
  Index bad_in_a_row() const { return bad_in_a_row_; }
  /// What moves groups of many numbers.
  Adam<S>& beside() { return beside_; }
  const Adam<S>& beside() const { return beside_; }
  bool is_beside(std::string_view group) const;

 private:
  using VectorX = Eigen::VectorXd;
  struct Moments {
    VectorX mean, square;
    Index steps = 0;
  };

  void make_matrix();
  bool set_factor(const Eigen::MatrixXd& correlations);
  bool is_beside_on(Index iteration) const;
  void move(Index iteration, Index iterations);

  Tape<S>& tape_;
  Var<S> loss_var_;
  OptimizerSettings settings_;
  std::vector<OptimizerGroup<S>> all_;
  std::vector<std::string> many_;  // names of groups that Adam moves
  UnitNumbers<S> numbers_;
  UnitCurvature<S> curvature_;
  Adam<S> beside_;
  std::vector<GroupStep> reports_;
  VectorX point_, before_, gradient_, step_, shares_;
  Moments moments_, moments_before_;
  Eigen::MatrixXd matrix_, correlations_;
  Eigen::LLT<Eigen::MatrixXd> factored_;
  double rate_ = 1;
  bool has_matrix_ = false, can_undo_ = false;
  Index rollbacks_ = 0, bad_in_a_row_ = 0;
};

extern template class WhitenedAdam<float>;
extern template class WhitenedAdam<double>;

}  // namespace hsi4d
