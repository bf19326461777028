#include "optim/quasi_newton.h"

#include <algorithm>
#include <cmath>

#include "core/check.h"

namespace hsi4d {

namespace {

constexpr double kArmijo = 1e-4;
constexpr double kShortest = 0.1, kLongest = 0.5;  // of the length before, where a step was too long
constexpr double kSmallestStep = 0.02;             // of the learning rates
constexpr Index kSmallSteps = 2;  // in a row: after a long step H tells too little of the numbers that it hardly moved
constexpr double kLeastCurvature = 1e-10;  // of |s| |y|

}  // namespace

double longest_quasi_newton_way(const ParameterGroupSettings& settings, Index iterations) {
  return settings.lr * std::min(kLongestUnitWay, kLongestQuasiNewtonStep * static_cast<double>(iterations));
}

template <class S>
QuasiNewton<S>::QuasiNewton(Tape<S>& tape, std::vector<OptimizerGroup<S>> groups)
    : numbers_(tape, std::move(groups), "bfgs") {
  const Index count = numbers_.count();
  for (VectorX* numbers : {&trial_, &trial_gradient_, &point_, &gradient_, &direction_, &moved_, &change_, &product_})
    numbers->setZero(count);
  trial_ = numbers_.start();
  first_ = Eigen::MatrixXd::Identity(count, count);
}

template <class S>
void QuasiNewton<S>::set_curvature(const std::vector<double>& inverse_hessian) {
  const Index n = numbers_.count();
  HSI4D_CHECK(steps_ == 0, "a curvature that comes after the first step");
  if (std::ssize(inverse_hessian) == n * n) first_ = Eigen::Map<const Eigen::MatrixXd>(inverse_hessian.data(), n, n);
}

template <class S>
std::vector<double> QuasiNewton<S>::curvature() const {
  return is_learnt_ ? whole_of(inverse_hessian_) : std::vector<double>();
}

template <class S>
StepReport QuasiNewton<S>::step(Index iteration, Index iterations, double loss) {
  StepReport report;
  report.bad = numbers_.read_gradient(loss, trial_gradient_);
  report.rolled_back = report.bad.has_value();
  if (report.rolled_back) ++rollbacks_;
  if (!report.rolled_back && (steps_ == 0 || loss <= loss_ + kArmijo * length_ * slope_)) {
    accept(loss);
    choose_direction();
  } else if (steps_ > 0) {
    shorten(report.rolled_back ? HUGE_VAL : loss);
  }
  if (steps_ > 0) {
    if (iteration + 1 >= iterations) done_ = true;
    trial_ = point_;
    if (!done_) trial_ += length_ * direction_;
    numbers_.write(trial_);
  }
  report.rollbacks = rollbacks_;
  report.groups = numbers_.reports();
  return report;
}

/// The trial becomes the point from which the next step goes.
template <class S>
void QuasiNewton<S>::accept(double loss) {
  if (steps_ > 0) {
    moved_ = trial_ - point_;
    change_ = trial_gradient_ - gradient_;
    const double curvature = moved_.dot(change_);
    if (curvature > kLeastCurvature * moved_.norm() * change_.norm()) {
      if (!is_learnt_) scale_first(change_, curvature);
      is_learnt_ = true;
      update_inverse_hessian(inverse_hessian_, moved_, change_, curvature, product_);
    }
  }
  point_ = trial_;
  gradient_ = trial_gradient_;
  loss_ = loss;
  ++steps_;
}

/// H becomes the first one, scaled so that yᵀ H y is `curvature`.
template <class S>
void QuasiNewton<S>::scale_first(const VectorX& y, double curvature) {
  product_.noalias() = first_ * y;
  inverse_hessian_ = first_ * (curvature / y.dot(product_));
}

template <class S>
void QuasiNewton<S>::choose_direction() {
  const double steepest = gradient_.cwiseAbs().maxCoeff();
  const Index n = gradient_.size();
  if (steps_ == 1 && steepest > 0) {
    product_.noalias() = first_ * gradient_;
    inverse_hessian_ = first_ / product_.cwiseAbs().maxCoeff();
  }
  direction_.setZero();
  if (steepest > 0) direction_.noalias() -= inverse_hessian_.selfadjointView<Eigen::Lower>() * gradient_;
  slope_ = direction_.dot(gradient_);
  if (!(slope_ < 0) && steepest > 0) {  // rounding has spoilt the matrix
    inverse_hessian_ = Eigen::MatrixXd::Identity(n, n) / steepest;
    direction_ = -gradient_ / steepest;
    slope_ = direction_.dot(gradient_);
  }
  length_ = 1;
  const double longest = direction_.cwiseAbs().maxCoeff();
  if (longest > kLongestQuasiNewtonStep) {
    direction_ *= kLongestQuasiNewtonStep / longest;
    slope_ *= kLongestQuasiNewtonStep / longest;
  }
  small_steps_ = longest >= kSmallestStep ? 0 : small_steps_ + 1;
  const double share = numbers_.share_within(point_, direction_);
  direction_ *= share;
  slope_ *= share;
  done_ = small_steps_ >= kSmallSteps || !(direction_.cwiseAbs().maxCoeff() > 0);
}

/// Nearer to the point: where the parabola through its loss and slope and the trial's loss is least.
template <class S>
void QuasiNewton<S>::shorten(double loss) {
  const double least = -slope_ * length_ / (2 * (loss - loss_ - slope_ * length_));
  length_ *= std::isfinite(loss) ? std::clamp(least, kShortest, kLongest) : kShortest;
  done_ = !(length_ * direction_.cwiseAbs().maxCoeff() >= kSmallestStep);
}

template class QuasiNewton<float>;
template class QuasiNewton<double>;

}  // namespace hsi4d
