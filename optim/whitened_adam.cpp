#include "optim/whitened_adam.h"

#include <algorithm>
#include <cmath>

#include "core/check.h"

namespace hsi4d {

template <class S>
WhitenedAdam<S>::WhitenedAdam(Tape<S>& tape, Var<S> loss, const std::vector<OptimizerGroup<S>>& groups,
                              const OptimizerSettings& settings)
    : tape_(tape),
      loss_var_(loss),
      settings_(settings),
      all_(groups),
      numbers_(tape, split_by_size(groups).few, "whitened_adam", true),
      curvature_(tape, loss, numbers_, settings, "whitened_adam"),
      beside_(tape, split_by_size(groups).many, settings) {
  if (numbers_.count() == 0) {
    throw UserError("whitened_adam: every group has more than " + std::to_string(kMostMatrixNumbers) +
                    " numbers; allowed: the optimizer adam");
  }
  for (const OptimizerGroup<S>& group : split_by_size(groups).many) many_.push_back(group.parameters.name);
  const Index count = numbers_.count();
  for (VectorX* numbers : {&gradient_, &step_, &shares_, &moments_.mean, &moments_.square}) numbers->setZero(count);
  point_ = before_ = numbers_.start();
  moments_before_ = moments_;
  factored_.compute(Eigen::MatrixXd::Identity(count, count));
}

template <class S>
bool WhitenedAdam<S>::is_beside(std::string_view group) const {
  return std::find(many_.begin(), many_.end(), group) != many_.end();
}

template <class S>
bool WhitenedAdam<S>::is_beside_on(Index iteration) const {
  return std::any_of(all_.begin(), all_.end(), [&](const OptimizerGroup<S>& group) {
    return is_beside(group.parameters.name) && moves_in(group.settings, iteration);
  });
}

template <class S>
StepReport WhitenedAdam<S>::step(Index iteration, Index iterations, double loss) {
  StepReport report;
  report.bad = numbers_.read_gradient(loss, gradient_);
  reports_.clear();
  if (!report.bad) {
    const bool makes = moments_.steps % settings_.matrix_every == 0 && (moments_.steps > 0 || !has_matrix_);
    if (makes) make_matrix();
    if (makes && is_beside_on(iteration)) {  // where a matrix was made the gradients are gone
      tape_.forward(loss_var_);
      tape_.backward(loss_var_);
    }
    const StepReport moved = beside_.step(iteration, iterations, loss);
    reports_.assign(moved.groups.begin(), moved.groups.end());
    report.bad = moved.bad;
  }
  if (report.bad) {
    ++rollbacks_;
    ++bad_in_a_row_;
    rate_ *= 0.5;
    report.undone = undo();
  } else {
    move(iteration, iterations);
    bad_in_a_row_ = 0;
    rate_ = std::min(1.0, rate_ * kRateRecovery);
  }
  report.rolled_back = report.bad.has_value();
  report.rollbacks = rollbacks_;
  reports_ = in_order_of(all_, numbers_.reports(), reports_);
  report.groups = reports_;
  report.matrix = {std::nullopt, settings_.damping, has_matrix_ ? condition_of(factored_) : HUGE_VAL, false};
  return report;
}

template <class S>
void WhitenedAdam<S>::make_matrix() {
  if (!curvature_.compute(matrix_)) return;
  const Index count = numbers_.count();
  VectorX root = matrix_.diagonal().cwiseMax(0).cwiseSqrt();
  for (Index i = 0; i < count; ++i) root[i] = root[i] > 0 ? 1 / root[i] : 0;
  matrix_ = root.asDiagonal() * matrix_ * root.asDiagonal() / (1 + settings_.damping);
  matrix_.diagonal().setOnes();
  set_factor(matrix_);
}

/// False where it has no factors; the last ones stay.
template <class S>
bool WhitenedAdam<S>::set_factor(const Eigen::MatrixXd& correlations) {
  Eigen::LLT<Eigen::MatrixXd> factored(correlations);
  if (factored.info() != Eigen::Success || !correlations.allFinite()) return false;
  const Eigen::MatrixXd turn = factored.matrixL().solve(Eigen::MatrixXd(factored_.matrixL()));
  moments_.mean = turn * moments_.mean;
  moments_.square = turn.cwiseAbs2() * moments_.square;
  factored_ = factored;
  correlations_ = correlations;
  has_matrix_ = true;
  return true;
}

template <class S>
void WhitenedAdam<S>::move(Index iteration, Index iterations) {
  before_ = point_;
  moments_before_ = moments_;
  numbers_.read_shares(iteration, iterations, shares_);
  ++moments_.steps;
  step_ = factored_.matrixL().solve(gradient_);
  moments_.mean = settings_.beta1 * moments_.mean + (1 - settings_.beta1) * step_;
  moments_.square = settings_.beta2 * moments_.square + (1 - settings_.beta2) * step_.cwiseAbs2();
  const double scale = 1 / bias_correction(settings_.beta1, moments_.steps),
               root_scale = 1 / bias_correction(settings_.beta2, moments_.steps);
  const VectorX& unit = numbers_.unit();  // ε is of gradients by the numbers themselves
  step_ = (scale * moments_.mean).array() / ((root_scale * moments_.square).array().sqrt() +
                                             settings_.eps * (unit.array() > 0).select(unit.array(), 1.0));
  step_ = factored_.matrixU().solve(step_);
  point_ -= rate_ * shares_.cwiseProduct(step_);
  point_ = point_.cwiseMax(numbers_.low()).cwiseMin(numbers_.high());
  numbers_.write(point_);
  can_undo_ = true;
}

template <class S>
bool WhitenedAdam<S>::undo() {
  beside_.undo();
  if (!can_undo_) return false;
  can_undo_ = false;
  point_ = before_;
  moments_ = moments_before_;
  numbers_.write(point_);
  return true;
}

template <class S>
void WhitenedAdam<S>::set_curvature(const std::vector<double>& correlations) {
  const Index n = numbers_.count();
  HSI4D_CHECK(moments_.steps == 0, "a curvature that comes after the first step");
  if (std::ssize(correlations) == n * n) set_factor(Eigen::Map<const Eigen::MatrixXd>(correlations.data(), n, n));
}

template <class S>
std::vector<double> WhitenedAdam<S>::curvature() const {
  return {correlations_.data(), correlations_.data() + correlations_.size()};
}

template class WhitenedAdam<float>;
template class WhitenedAdam<double>;

}  // namespace hsi4d
