#include "optim/levenberg_marquardt.h"

#include <algorithm>
#include <cmath>

#include "core/check.h"

namespace hsi4d {

namespace {

constexpr double kLeastGain = 1e-4;        // ρ of a step that is taken
constexpr double kSmallMatrixStep = 0.02;  // of the learning rates
constexpr Index kSmallMatrixSteps = 2;     // in a row, after which nothing is left to gain
constexpr double kLeastDamping = 1e-9, kMostDamping = 1e12;
constexpr double kLeastStiffness = 0.125;  // of σ, and of one look at it
constexpr double kBadGrowth = 10;          // of λ, after a bad evaluation
constexpr Index kMostSolves = 8;           // to find what damps the numbers that go too far
constexpr double kLeastShare = 1e-3;       // of the mean of H's diagonal, for what is seen less

}  // namespace

double longest_matrix_way(const ParameterGroupSettings& settings, Index iterations) {
  return settings.lr * std::min(kLongestUnitWay, kLongestMatrixStep * static_cast<double>(iterations));
}

template <class S>
LevenbergMarquardt<S>::LevenbergMarquardt(Tape<S>& tape, Var<S> loss, const std::vector<OptimizerGroup<S>>& groups,
                                          const OptimizerSettings& settings)
    : tape_(tape),
      loss_var_(loss),
      settings_(settings),
      all_(groups),
      numbers_(tape, split_by_size(groups).few, "lm", true),
      curvature_(tape, loss, numbers_, settings, "lm"),
      beside_(tape, split_by_size(groups).many, settings),
      damping_(settings.damping) {
  if (numbers_.count() == 0) {
    throw UserError("lm: every group has more than " + std::to_string(kMostMatrixNumbers) +
                    " numbers; allowed: the optimizer adam");
  }
  for (const OptimizerGroup<S>& group : split_by_size(groups).many) many_.push_back(group.parameters.name);
  const Index count = numbers_.count();
  for (VectorX* numbers : {&trial_gradient_, &gradient_, &step_, &own_damping_}) numbers->setZero(count);
  point_ = trial_ = numbers_.start();
}

template <class S>
bool LevenbergMarquardt<S>::is_beside(std::string_view group) const {
  return std::find(many_.begin(), many_.end(), group) != many_.end();
}

template <class S>
StepReport LevenbergMarquardt<S>::step(Index iteration, Index iterations, double loss) {
  StepReport report;
  report.bad = numbers_.read_gradient(loss, trial_gradient_);
  judge(report.bad.has_value(), loss);
  report.undone = refused_ && moved_beside_ && beside_.undo();
  moved_beside_ = false;
  reports_.clear();
  if (iteration + 1 >= iterations) done_ = true;
  if (!refused_ && !done_ && !report.bad) {
    if ((accepted_ - 1) % settings_.matrix_every == 0) make_matrix();
    move_beside(iteration, iterations, loss, report);
  }
  if (accepted_ > 0) {
    if (!done_) choose_step();
    trial_ = point_;
    if (!done_) trial_ += step_;
    numbers_.write(trial_);
  }
  report.rolled_back = report.bad.has_value();
  if (report.rolled_back) ++rollbacks_;
  report.rollbacks = rollbacks_;
  reports_ = in_order_of(all_, numbers_.reports(), reports_);
  report.groups = reports_;
  report.matrix = {gain_ratio_, damping_, accepted_ > 0 && !done_ ? condition_of(factored_) : HUGE_VAL, refused_};
  return report;
}

/// Takes the evaluated step, or takes it back.
template <class S>
void LevenbergMarquardt<S>::judge(bool is_bad, double loss) {
  gain_ratio_.reset();
  refused_ = false;
  if (accepted_ == 0) {
    if (!is_bad) accept(loss);
    return;
  }
  if (!is_bad) gain_ratio_ = (loss_ - loss) / predicted_;
  if (is_bad || !(*gain_ratio_ > kLeastGain)) return refuse(is_bad);
  const double centred = 2 * *gain_ratio_ - 1;
  damping_ = std::max(kLeastDamping, damping_ * std::max(1.0 / 3, 1 - centred * centred * centred));
  growth_ = 2;
  if (bend_ > 0) {
    const double seen = std::clamp(2 * (-slope_ - (loss_ - loss)) / bend_, kLeastStiffness, 1.0);
    stiffness_ = std::sqrt(stiffness_ * seen);
  }
  accept(loss);
}

template <class S>
void LevenbergMarquardt<S>::accept(double loss) {
  point_ = trial_;
  gradient_ = trial_gradient_;
  loss_ = loss;
  ++accepted_;
}

template <class S>
void LevenbergMarquardt<S>::refuse(bool is_bad) {
  refused_ = true;
  damping_ *= is_bad ? kBadGrowth : growth_;
  if (!is_bad) growth_ *= 2;
  stiffness_ = std::min(1.0, 2 * stiffness_);
}

/// H, with what it does not see held by its gradient.
template <class S>
void LevenbergMarquardt<S>::make_matrix() {
  if (!curvature_.compute(matrix_) && matrix_.size() == 0) matrix_.setZero(numbers_.count(), numbers_.count());
  for (Index i = 0; i < numbers_.count(); ++i)
    matrix_(i, i) = std::max(matrix_(i, i), std::fabs(gradient_[i]) / kLongestMatrixStep);
}

/// Where a matrix was made the gradients are gone.
template <class S>
void LevenbergMarquardt<S>::move_beside(Index iteration, Index iterations, double loss, StepReport& report) {
  const bool is_on = std::any_of(all_.begin(), all_.end(), [&](const OptimizerGroup<S>& group) {
    return is_beside(group.parameters.name) && moves_in(group.settings, iteration);
  });
  if (is_on && (accepted_ - 1) % settings_.matrix_every == 0) {
    tape_.forward(loss_var_);
    tape_.backward(loss_var_);
  }
  const StepReport moved = beside_.step(iteration, iterations, loss);
  reports_.assign(moved.groups.begin(), moved.groups.end());
  if (moved.bad) report.bad = moved.bad;
  moved_beside_ = is_on && !moved.rolled_back;
}

template <class S>
bool LevenbergMarquardt<S>::is_held(Index i) const {
  return !(numbers_.unit()[i] > 0) || (gradient_[i] > 0 && point_[i] <= numbers_.low()[i]) ||
         (gradient_[i] < 0 && point_[i] >= numbers_.high()[i]);
}

/// Damps until the step is one that the matrix says to be a gain.
template <class S>
void LevenbergMarquardt<S>::choose_step() {
  while (!solve()) {
    damping_ *= kBadGrowth;
    if (damping_ > kMostDamping) {
      done_ = true;
      return;
    }
  }
  small_steps_ = step_.cwiseAbs().maxCoeff() >= kSmallMatrixStep ? 0 : small_steps_ + 1;
  done_ = small_steps_ >= kSmallMatrixSteps;
}

/// The step of this damping. False where it is none that gains.
template <class S>
bool LevenbergMarquardt<S>::solve() {
  const double least = kLeastShare * matrix_.diagonal().mean();
  undamped_ = stiffness_ * matrix_;
  for (Index i = 0; i < numbers_.count(); ++i)
    undamped_(i, i) += damping_ * stiffness_ * std::max(matrix_(i, i), least);
  own_damping_ *= 0.5;
  bool is_short = false;
  for (Index i = 0; i < kMostSolves && !is_short; ++i) {
    if (!solve_damped()) return false;
    is_short = damp_long_numbers();
  }
  step_ = step_.cwiseMax(-kLongestMatrixStep).cwiseMin(kLongestMatrixStep);
  step_ = (point_ + step_).cwiseMax(numbers_.low()).cwiseMin(numbers_.high()) - point_;
  slope_ = gradient_.dot(step_);
  bend_ = step_.dot(matrix_.selfadjointView<Eigen::Lower>() * step_);
  predicted_ = -slope_ - 0.5 * stiffness_ * bend_;
  return predicted_ > 0 || step_.isZero(0);
}

template <class S>
bool LevenbergMarquardt<S>::solve_damped() {
  damped_ = undamped_;
  damped_.diagonal() += own_damping_;
  step_ = -gradient_;
  for (Index i = 0; i < numbers_.count(); ++i) {
    if (!is_held(i)) continue;
    damped_.row(i).setZero();
    damped_.col(i).setZero();
    damped_(i, i) = 1;
    step_[i] = 0;
  }
  factored_.compute(damped_);
  if (factored_.info() != Eigen::Success) return false;
  factored_.solveInPlace(step_);
  return step_.allFinite();
}

/// Whether no number goes too far; those that do are damped more, each for itself, so that what the image hardly tells
/// does not hold back the rest.
template <class S>
bool LevenbergMarquardt<S>::damp_long_numbers() {
  bool is_short = true;
  for (Index i = 0; i < numbers_.count(); ++i) {
    const double share = std::fabs(step_[i]) / kLongestMatrixStep;
    if (share <= 1) continue;
    is_short = false;
    own_damping_[i] += 2 * (share - 1) * damped_(i, i);
  }
  return is_short;
}

template class LevenbergMarquardt<float>;
template class LevenbergMarquardt<double>;

}  // namespace hsi4d
