#include "optim/gauss_newton.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/check.h"

namespace hsi4d {

namespace {

constexpr double kProbe = 0.1;          // h p of a product, in learning rates: small for a step, large for rounding
constexpr double kShorterProbe = 0.1;   // of the one before, where that was bad
constexpr double kFirstDamping = 1e-4;  // of the first direction's curvature
constexpr double kLeastGain = 1e-4;     // of the model's, for a step that is taken
constexpr double kSmallestProductStep = 0.02;     // of the learning rates
constexpr double kSmallestGain = 1e-6;            // of the loss: a few roundings of it in float
constexpr double kEnough = 0.5;                   // of the mean gain of a direction: one that gives less is the last
constexpr double kLeastProductCurvature = 1e-10;  // of |p| |B p|
constexpr double kLeastNew = 1e-6;                // of a direction, across those before
constexpr double kLeastDamping = 1e-30, kMostDamping = 1e30;

double largest(const Eigen::VectorXd& x) { return x.size() == 0 ? 0 : x.cwiseAbs().maxCoeff(); }

/// Solves (A + λ I) x = b by Cholesky's method; false where the matrix is not positive definite. `factor` is memory.
bool solve_damped(const Eigen::MatrixXd& a, double damping, Index n, Eigen::MatrixXd& factor, Eigen::VectorXd& x) {
  for (Index j = 0; j < n; ++j) {
    for (Index i = j; i < n; ++i) {
      double sum = a(i, j) + (i == j ? damping : 0);
      for (Index k = 0; k < j; ++k) sum -= factor(i, k) * factor(j, k);
      if (i == j && !(sum > 0)) return false;
      factor(i, j) = i == j ? std::sqrt(sum) : sum / factor(j, j);
    }
  }
  for (Index i = 0; i < n; ++i) {
    for (Index k = 0; k < i; ++k) x[i] -= factor(i, k) * x[k];
    x[i] /= factor(i, i);
  }
  for (Index i = n - 1; i >= 0; --i) {
    for (Index k = i + 1; k < n; ++k) x[i] -= factor(k, i) * x[k];
    x[i] /= factor(i, i);
  }
  return true;
}

}  // namespace

double longest_gauss_newton_way(const ParameterGroupSettings& settings, Index iterations) {
  const double steps = kLongestGaussNewtonStep * static_cast<double>(iterations);
  return settings.lr * std::min(kLongestUnitWay, steps + kProbe);
}

template <class S>
GaussNewton<S>::GaussNewton(Tape<S>& tape, std::vector<OptimizerGroup<S>> groups, Index products, SeamMode& seams)
    : numbers_(tape, std::move(groups), "gauss_newton"), seams_(seams), probe_(kProbe) {
  HSI4D_CHECK(products > 0, "no products");
  const Index n = numbers_.count();
  most_products_ = std::min(products, n);
  for (VectorX* numbers : {&trial_, &trial_gradient_, &point_, &gradient_, &step_, &residual_, &next_})
    numbers->setZero(n);
  for (MatrixX* matrix : {&directions_, &products_}) matrix->setZero(n, most_products_);
  for (MatrixX* matrix : {&reduced_, &factor_}) matrix->setZero(most_products_, most_products_);
  weights_.setZero(most_products_);
  inverse_ = MatrixX::Identity(n, n);
  trial_ = numbers_.start();
  seams_ = {};
}

template <class S>
void GaussNewton<S>::set_curvature(const std::vector<double>& inverse_hessian) {
  const Index n = numbers_.count();
  HSI4D_CHECK(steps_ == 0, "a curvature that comes after the first step");
  if (std::ssize(inverse_hessian) == n * n) inverse_ = Eigen::Map<const MatrixX>(inverse_hessian.data(), n, n);
}

template <class S>
StepReport GaussNewton<S>::step(Index iteration, Index iterations, double loss) {
  StepReport report;
  report.bad = numbers_.read_gradient(loss, trial_gradient_);
  report.rolled_back = report.bad.has_value();
  if (report.rolled_back) ++rollbacks_;
  if (is_product_ && report.rolled_back) {
    probe_ *= kShorterProbe;
  } else if (is_product_) {
    add_product();
  } else if (!report.rolled_back && (steps_ == 0 || loss_ - loss >= kLeastGain * gain_)) {
    accept(loss);
  } else if (steps_ > 0) {
    damp_more();
  }
  if (steps_ > 0) {  // else all evaluations were bad, and the next is the same
    const Index left = iterations - 1 - iteration;
    const bool is_room = left >= 2 && count_ < most_products_ && !is_refused_;  // for a product and a step
    if (is_room && !is_solved() && find_direction()) {
      ask_for_product();
    } else {
      done_ = left < 1 || !(largest(step_) >= kSmallestProductStep) || !(gain_ > kSmallestGain * std::fabs(loss_));
      ask_for_step();
    }
  }
  report.rollbacks = rollbacks_;
  report.groups = numbers_.reports();
  return report;
}

/// The trial becomes the point from which the next step goes.
template <class S>
void GaussNewton<S>::accept(double loss) {
  if (steps_ > 0) {
    const double off = 2 * (loss_ - loss) / gain_ - 1;
    damping_ *= std::clamp(1 - off * off * off, 1.0 / 3, 2.0);
    growth_ = 2;
  }
  point_ = trial_;
  gradient_ = trial_gradient_;
  loss_ = loss;
  count_ = 0;
  is_refused_ = false;
  gain_ = gain_before_ = 0;
  step_.setZero();
  ++steps_;
}

/// The step was too long: a shorter one by the same products.
template <class S>
void GaussNewton<S>::damp_more() {
  is_refused_ = true;
  damping_ = growth_ * used_damping_;
  growth_ *= 2;
  solve();
}

/// The evaluation has told B p of the direction that was asked for.
template <class S>
void GaussNewton<S>::add_product() {
  directions_.col(count_) = next_;
  products_.col(count_) = trial_gradient_;
  for (Index i = 0; i <= count_; ++i) {  // symmetric but for rounding and the length of h p
    reduced_(i, count_) = reduced_(count_, i) =
        (directions_.col(i).dot(products_.col(count_)) + directions_.col(count_).dot(products_.col(i))) / 2;
  }
  ++count_;
  if (damping_ == 0) damping_ = kFirstDamping * std::fabs(reduced_(0, 0));
  learn(next_, trial_gradient_);
  solve();
}

/// M B p = p from now on.
template <class S>
void GaussNewton<S>::learn(const VectorX& direction, const VectorX& product) {
  const double curvature = direction.dot(product);
  if (!(curvature > kLeastProductCurvature * direction.norm() * product.norm())) return;
  if (!is_learnt_) {
    residual_.noalias() = inverse_.template selfadjointView<Eigen::Lower>() * product;
    inverse_ *= curvature / product.dot(residual_);
  }
  is_learnt_ = true;
  update_inverse_hessian(inverse_, direction, product, curvature, residual_);
}

/// The step by the products at hand, damped until it is one downhill and no longer than it may be.
template <class S>
void GaussNewton<S>::solve() {
  gain_before_ = std::exchange(gain_, 0);
  step_.setZero();
  const auto directions = directions_.leftCols(count_);
  for (used_damping_ = damping_; used_damping_ <= kMostDamping;
       used_damping_ = std::max(2 * used_damping_, kLeastDamping)) {
    for (Index i = 0; i < count_; ++i) weights_[i] = -directions_.col(i).dot(gradient_);
    if (!solve_damped(reduced_, used_damping_, count_, factor_, weights_)) continue;
    step_.noalias() = directions * weights_.head(count_);
    if (largest(step_) <= kLongestGaussNewtonStep) break;
  }
  const double share = numbers_.share_within(point_, step_, kLongestUnitWay - kProbe);
  weights_ *= share;
  step_ *= share;
  for (Index i = 0; i < count_; ++i) {  // −gᵀd − ½ dᵀBd
    double curvature = 0;
    for (Index j = 0; j < count_; ++j) curvature += reduced_(i, j) * weights_[j];
    gain_ -= weights_[i] * (directions_.col(i).dot(gradient_) + curvature / 2);
  }
}

/// The last direction gave little of what the model gains.
template <class S>
bool GaussNewton<S>::is_solved() const {
  return count_ > 1 && gain_ - gain_before_ < kEnough * gain_ / static_cast<double>(count_);
}

/// The next direction, of length 1; false where those at hand leave nothing over.
template <class S>
bool GaussNewton<S>::find_direction() {
  residual_ = -gradient_ - used_damping_ * step_;
  residual_.noalias() -= products_.leftCols(count_) * weights_.head(count_);
  next_.noalias() = inverse_.template selfadjointView<Eigen::Lower>() * residual_;
  const double length = next_.norm();
  if (!(length > 0)) return false;
  next_ /= length;
  for (int pass = 0; pass < 2; ++pass) {  // the second takes away what rounding left
    for (Index i = 0; i < count_; ++i) next_ -= directions_.col(i).dot(next_) * directions_.col(i);
  }
  const double left = next_.norm();
  if (!(left > kLeastNew)) return false;
  next_ /= left;
  return true;
}

template <class S>
void GaussNewton<S>::ask_for_product() {
  const double h = probe_ / next_.cwiseAbs().maxCoeff();
  trial_ = point_ + h * next_;
  numbers_.write(trial_);
  seams_ = {true, 1 / h};
  is_product_ = true;
}

template <class S>
void GaussNewton<S>::ask_for_step() {
  trial_ = point_;
  if (!done_) trial_ += step_;
  numbers_.write(trial_);
  seams_ = {};
  is_product_ = false;
}

template class GaussNewton<float>;
template class GaussNewton<double>;

}  // namespace hsi4d
