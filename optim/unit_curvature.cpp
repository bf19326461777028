#include "optim/unit_curvature.h"

#include <algorithm>
#include <cmath>

#include "core/check.h"

namespace hsi4d {

template <class S>
SplitGroups<S> split_by_size(std::vector<OptimizerGroup<S>> groups) {
  SplitGroups<S> split;
  for (OptimizerGroup<S>& group : groups) {
    Index count = 0;
    for (const Var<S> block : group.parameters.blocks) count += block.shape().count();
    (count > kMostMatrixNumbers ? split.many : split.few).push_back(std::move(group));
  }
  return split;
}

template <class S>
std::vector<GroupStep> in_order_of(const std::vector<OptimizerGroup<S>>& all, std::span<const GroupStep> few,
                                   std::span<const GroupStep> many) {
  std::vector<GroupStep> ordered;
  for (const OptimizerGroup<S>& group : all) {
    ordered.push_back({group.parameters.name});
    for (const auto& reports : {few, many}) {
      for (const GroupStep& report : reports) {
        if (report.name == group.parameters.name)
          ordered.back() = {group.parameters.name, report.moved, report.learning_rate, report.gradient_norm};
      }
    }
  }
  return ordered;
}

template <class S>
UnitCurvature<S>::UnitCurvature(Tape<S>& tape, Var<S> loss, const UnitNumbers<S>& numbers,
                                const OptimizerSettings& settings, std::string method)
    : curvature_(tape, loss, numbers.blocks(),
                 {.least_difference = settings.matrix_floor,
                  .tiles = settings.matrix_tiles,
                  .turn = 0,
                  .structural = settings.matrix_ssim}),
      numbers_(numbers),
      method_(std::move(method)) {}

template <class S>
bool UnitCurvature<S>::compute(Eigen::MatrixXd& matrix) {
  const Eigen::VectorXd& unit = numbers_.unit();
  try {
    const Eigen::MatrixXd& found = curvature_.compute();
    if (!found.allFinite()) return false;
    matrix = unit.asDiagonal() * found * unit.asDiagonal();
    return true;
  } catch (const InternalError& error) {
    throw UserError(method_ + " has no matrix of what moves: " + error.what() + "; allowed: the optimizer adam");
  }
}

double condition_of(const Eigen::LLT<Eigen::MatrixXd>& factored) {
  const double reciprocal = factored.rcond();
  return reciprocal > 0 ? 1 / reciprocal : HUGE_VAL;
}

template SplitGroups<float> split_by_size(std::vector<OptimizerGroup<float>>);
template SplitGroups<double> split_by_size(std::vector<OptimizerGroup<double>>);
template std::vector<GroupStep> in_order_of(const std::vector<OptimizerGroup<float>>&, std::span<const GroupStep>,
                                            std::span<const GroupStep>);
template std::vector<GroupStep> in_order_of(const std::vector<OptimizerGroup<double>>&, std::span<const GroupStep>,
                                            std::span<const GroupStep>);
template class UnitCurvature<float>;
template class UnitCurvature<double>;

}  // namespace hsi4d
