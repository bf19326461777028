// The Gauss-Newton matrix of a stage by its small groups, in units of their learning rates; and what stands beside it.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Cholesky>

#include "autodiff/curvature.h"
#include "optim/unit_numbers.h"

namespace hsi4d {

/// Groups of more numbers than this are in no matrix: nets, features of Gaussians. Adam moves them.
inline constexpr Index kMostMatrixNumbers = 512;

/// Groups of one stage.
template <class S>
struct SplitGroups {
  std::vector<OptimizerGroup<S>> few, many;
};

/// Groups that a matrix can have, and the others.
template <class S>
SplitGroups<S> split_by_size(std::vector<OptimizerGroup<S>> groups);

/// The reports of both in the order of `all`; of a group that neither has: nothing moved.
template <class S>
std::vector<GroupStep> in_order_of(const std::vector<OptimizerGroup<S>>& all, std::span<const GroupStep> few,
                                   std::span<const GroupStep> many);

/// H = U (∂²loss/∂x²) U with U the learning rates: autodiff/curvature.h in units.
template <class S>
class UnitCurvature {
 public:
  /// @param method  what messages call it
  UnitCurvature(Tape<S>& tape, Var<S> loss, const UnitNumbers<S>& numbers, const OptimizerSettings& settings,
                std::string method);

  /// H at the tape's last forward and backward run of the loss, whose gradients are gone afterwards. False where a
  /// number of it is not finite; H is then as it was. Throws UserError where a render moves in a way that has no
  /// matrix.
  bool compute(Eigen::MatrixXd& matrix);

 private:
  Curvature<S> curvature_;
  const UnitNumbers<S>& numbers_;
  std::string method_;
};

extern template class UnitCurvature<float>;
extern template class UnitCurvature<double>;

/// An estimate of the condition of a factored matrix, in the 1-norm.
double condition_of(const Eigen::LLT<Eigen::MatrixXd>& factored);

}  // namespace hsi4d
